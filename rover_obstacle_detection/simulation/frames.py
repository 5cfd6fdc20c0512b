"""Render the stereo pairs of a scene with their ground truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.simulation import labels as labelling
from rover_obstacle_detection.simulation import streams
from rover_obstacle_detection.simulation.description import Scene
from rover_obstacle_detection.simulation.ground_mesh import (
    GroundMesh,
    fan,
    fan_mesh,
    surrounding_mesh,
)
from rover_obstacle_detection.simulation.poses import CameraPose, drive, right_of
from rover_obstacle_detection.simulation.renderer import Hits, Renderer, load_mitsuba
from rover_obstacle_detection.simulation.rock_shapes import RockMaker, RockMesh
from rover_obstacle_detection.simulation.rocks import scatter
from rover_obstacle_detection.simulation.sensor import automatic_exposure, develop
from rover_obstacle_detection.simulation.shade import shade_mesh
from rover_obstacle_detection.simulation.sky import make_light, through_haze
from rover_obstacle_detection.simulation.soil import PALETTES, Soil
from rover_obstacle_detection.simulation.terrain import Terrain

Floats = NDArray[np.float32]
STEPS_PER_FRAME = 4
"""Progress steps: scene, labels, left image, right image."""
_TEXELS_PER_CELL = 2
"""Soil texels along each side of a cell of the ground mesh."""
_SMALLEST_ROCK_PX = 2.0
"""Narrower rocks are not meshed."""
_NEAREST_ROCK_M = 0.3
"""Bounds the apparent size, and so the mesh resolution, of rocks next to the camera."""


@dataclass(frozen=True)
class Frame:
    """A stereo pair with the ground truth of its left image.

    Parameters
    ----------
    left, right : ndarray of uint8 or uint16
        Shape (height, width), or (height, width, 3) in RGB for a colour rig.
    labels : ndarray of uint8, shape (height, width)
        See `labels.label`.
    instances : ndarray of uint16, shape (height, width)
        Rock number; 0 for ground and sky.
    depth_m : ndarray of float32, shape (height, width)
        Along the optical axis; NaN where there is no surface.
    pose : CameraPose
        Of the left camera.
    camera : StereoCamera
    """

    left: NDArray[np.uint8] | NDArray[np.uint16]
    right: NDArray[np.uint8] | NDArray[np.uint16]
    labels: NDArray[np.uint8]
    instances: NDArray[np.uint16]
    depth_m: Floats
    pose: CameraPose
    camera: StereoCamera


class SceneWorld:
    """The terrain, rocks and light of a scene, and the camera poses of its drive.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.rig = scene.rig_used()
        self.camera = self.rig.camera(scene.image_width)
        self.terrain = Terrain(scene.terrain, scene.seed)
        self.poses = drive(self.terrain.height, self.rig, scene.drive)
        self.rocks = scatter(scene.rocks, self.rig, self.camera, self.poses, scene.seed)
        if self.terrain.landforms.present:
            self.rocks = self.rocks.away_from_edges(self.terrain.landforms.height)
        self.terrain.heap(self.rocks.aprons(self.poses))
        self.soil = Soil(scene.soil, scene.seed)
        self.palette = PALETTES[scene.soil.world]
        self.rock_maker = RockMaker(scene.seed, self.palette.rocks, scene.rocks)
        self.light = make_light(scene.light, scene.soil.world)

    def rock_mesh(self, pose: CameraPose) -> RockMesh:
        """Mesh the rocks visible from a pose, at the resolution of the image."""
        rocks = self.rocks
        x, y = pose.ground_below
        distance = np.hypot(rocks.x_m - x, rocks.y_m - y)
        range_m = np.maximum(np.hypot(distance, self.rig.camera_height_m), _NEAREST_ROCK_M)
        size_px = self.camera.fx * rocks.diameter_m / range_m
        chosen = np.flatnonzero(size_px > _SMALLEST_ROCK_PX)
        ground = self.terrain.height(
            rocks.x_m[chosen].astype(np.float32), rocks.y_m[chosen].astype(np.float32)
        )
        return self.rock_maker.mesh(rocks, chosen, ground.astype(np.float64), size_px[chosen])

    def renderer(self, pose: CameraPose, rocks: RockMesh) -> Renderer:
        """Build the renderer of one pose."""
        places = fan(self.rig, self.camera, pose, self.terrain.landforms)
        texture = self.soil.texture(places.refined(_TEXELS_PER_CELL), self.terrain)
        cosine, sine = np.cos(pose.heading_rad), np.sin(pose.heading_rad)
        x0, y0 = pose.ground_below
        first_row = (places.x_m[0] - x0) * cosine + (places.y_m[0] - y0) * sine
        return Renderer(
            fan_mesh(places, self.terrain.height),
            texture,
            surrounding_mesh(pose, self.terrain.height, float(first_row.min())),
            rocks,
            self.light,
            self.palette.soil,
            self._shade(),
        )

    def _shade(self) -> GroundMesh | None:
        light = self.scene.light
        place = np.array([[light.shade_ahead_m], [light.shade_left_m]], np.float32)
        ground_m = float(self.terrain.height(*place)[0])
        return shade_mesh(light, self.light.sun_direction, ground_m, self.scene.seed)

    def label(self, hits: Hits, pose: CameraPose, rocks: RockMesh) -> NDArray[np.uint8]:
        """Label the pixels of the left image."""
        rays = np.stack(np.broadcast_arrays(*self.camera.rays(), np.float32(1)), axis=2)
        points = pose.to_world(rays.astype(np.float64) * hits.depth_m[..., np.newaxis])
        with np.errstate(invalid='ignore'):
            seen = points[hits.depth_m <= self.scene.truth.range_m]
        if not len(seen):
            return np.full(hits.depth_m.shape, labelling.NOT_COUNTED, np.uint8)
        low, high = seen.min(0), seen.max(0)
        ground = labelling.local_ground(self.terrain.height, low[:2].tolist(), high[:2].tolist())
        return labelling.label(
            points,
            hits.depth_m,
            hits.instances,
            rock_heights(rocks, ground, len(self.rocks)),
            ground,
            self.scene.truth,
        )


def rock_heights(
    rocks: RockMesh, ground: labelling.LocalGround, number: int
) -> NDArray[np.float32]:
    """Return the height (m) of each rock above the local ground, by instance number."""
    heights = np.zeros(number + 1, np.float32)
    x, y, z = rocks.vertices.T
    above = z - ground.read(ground.height_m, x, y)
    for corner in range(3):
        np.maximum.at(heights, rocks.instance, above[rocks.faces[:, corner]])
    return heights


def render(scene: Scene, on_step: Callable[[], None] = lambda: None) -> Iterator[Frame]:
    """Render the frames of a scene.

    Parameters
    ----------
    scene : Scene
    on_step : callable
        Called `STEPS_PER_FRAME` times per frame.

    Raises
    ------
    MissingExtraError
        If Mitsuba or its LLVM is not installed.
    """
    load_mitsuba()
    world = SceneWorld(scene)
    exposure: float | None = None
    for number, pose in enumerate(world.poses):
        rocks = world.rock_mesh(pose)
        renderer = world.renderer(pose, rocks)
        on_step()
        hits = renderer.cast(world.camera, pose)
        labels = world.label(hits, pose, rocks)
        on_step()
        left = _light(world, renderer, world.camera, pose, hits, (number, 0))
        on_step()
        camera, right_pose = right_camera(scene, world.camera, pose)
        right_hits = renderer.cast(camera, right_pose)
        right = _light(world, renderer, camera, right_pose, right_hits, (number, 1))
        on_step()
        if exposure is None:
            # Fixed during the drive, as on a rover during a traverse.
            exposure = automatic_exposure(left, ~np.isnan(hits.depth_m))
        yield Frame(
            left=_image(world, left, exposure, (number, 0)),
            right=_image(world, right, exposure, (number, 1)),
            labels=labels,
            instances=hits.instances,
            depth_m=hits.depth_m,
            pose=pose,
            camera=world.camera,
        )


def right_camera(
    scene: Scene, left: StereoCamera, pose: CameraPose
) -> tuple[StereoCamera, CameraPose]:
    """Return the actual right camera, including the rectification error of the scene."""
    camera = replace(left, cy=left.cy - scene.sensor.row_error_px)
    return camera, right_of(pose, left.baseline_m, scene.sensor.roll_error_deg)


def _light(
    world: SceneWorld,
    renderer: Renderer,
    camera: StereoCamera,
    pose: CameraPose,
    hits: Hits,
    stream: tuple[int, int],
) -> Floats:
    """Render the light of one image; `stream` is the frame number and 0 (left) or 1 (right)."""
    scene = world.scene
    # Stereo would match render noise that both images share.
    rng = np.random.default_rng([scene.seed, streams.LIGHT_PATHS, *stream])
    seed = int(rng.integers(0, 2**31))
    radiance = renderer.radiance(camera, pose, scene.sensor.samples, seed)
    return through_haze(radiance, hits.depth_m, world.light, scene.light.haze_m)


def _image(
    world: SceneWorld, light: Floats, exposure: float, stream: tuple[int, int]
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    sensor = world.scene.sensor
    return develop(
        light,
        sensor,
        exposure,
        np.random.default_rng([world.scene.seed, streams.SENSOR, *stream]),
        gain=sensor.right_gain if stream[1] else 1.0,
        blur_px=sensor.right_blur_px if stream[1] else 0.0,
        colour=world.rig.colour and sensor.bits == 8,
    )
