"""Views of random ground that are not rendered: exact geometry, with errors as of matching.

They take a few seconds each, where rendering takes a minute, but have no light and, instead of
rocks, boxes: walls, posts, vehicles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from hazard_training.examples import (
    MapExample,
    examples_of_terrain,
    limits_of,
    random_limits,
)
from hazard_training.random_ground import Box, random_boxes, random_ground
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.plane_fit import estimate_ground
from rover_obstacle_detection.detection.geometry.resolution import working_camera
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.brims import find_brims
from rover_obstacle_detection.detection.terrain.survey import survey
from rover_obstacle_detection.evaluation.labels import NOT_COUNTED
from rover_obstacle_detection.simulation import labels as labelling
from rover_obstacle_detection.simulation.description import Scene
from rover_obstacle_detection.simulation.poses import CameraPose, drive
from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.terrain import Terrain as Ground

Image = NDArray[np.float32]

FIRST_SEED = 100_000
_DEFAULT_LIMITS_SHARE = 0.4

_NEAREST_M, _FARTHEST_M, _STEPS = 0.3, 42.0, 420
"""Distances at which a ray is compared with the ground."""

_NEAR_M, _NEAR_CELL_M = 7.5, 0.025
_FAR_CELL_M = 0.12
"""Half the side of the finer grid of heights, and the cells of both."""

_LINE = 4096

_BOX_MARGIN_M = 0.05
"""Height over the ground from which a pixel shows a box, and distance from it. Grids blur both."""

_NOISE_PX = (0.03, 0.25)
_NOISE_SCALE_PX = (1.5, 3.5)
_EDGE_PX = 0.8
"""Disparity across which matching keeps the nearer surface instead of smoothing."""

_TILT_DEG = (1.0, 2.5)
"""Usual and larger error of the vertical."""


@dataclass(frozen=True, eq=False)
class _Grid:
    """Heights of the ground on a grid."""

    x0_m: float
    y0_m: float
    cell_m: float
    height_m: Image

    def read(self, x_m: Image, y_m: Image) -> tuple[Image, NDArray[np.bool_]]:
        """Heights at n places, and which of them lie on the grid."""
        column = ((x_m - self.x0_m) / self.cell_m).astype(np.float32)
        row = ((y_m - self.y0_m) / self.cell_m).astype(np.float32)
        # OpenCV takes no lines of any length.
        lines = math.ceil(len(column) / _LINE), _LINE
        found = cv2.remap(
            self.height_m, np.resize(column, lines), np.resize(row, lines), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        side = len(self.height_m) - 1
        inside = (column > 0) & (row > 0) & (column < side) & (row < side)
        return np.asarray(found.ravel()[: len(column)], np.float32), inside


def drawn_examples(number: int) -> list[MapExample]:
    """Draw a ground, look at it, and make an example of each map.

    Parameters
    ----------
    number : int
        The same number gives the same examples.
    """
    generator = np.random.default_rng([number, 77])
    scene = scene_of(**random_ground(FIRST_SEED + number, generator))
    usual = generator.uniform() < _DEFAULT_LIMITS_SHARE
    config = DetectorConfig() if usual else random_limits(generator)
    parameters = DetectorParameters.from_config(config)
    ground = Ground(scene.terrain, scene.seed)
    rig = scene.rig_used()
    pose = drive(ground.height, rig, scene.drive)[0]
    boxes = random_boxes(pose, rig.view_distance_m, generator)
    camera, depth_m = _seen(scene, ground, boxes, pose, parameters)
    stereo, is_false = _matched(depth_m, camera, pose, parameters, generator)
    labels = _labels(depth_m, camera, pose, ground, config, scene)
    labels[is_false | _on_a_box(depth_m, camera, pose, ground, boxes)] = NOT_COUNTED
    terrain = survey(stereo, parameters.terrain)
    edges = find_brims(stereo, parameters.terrain).edge(parameters.terrain.brims)
    return examples_of_terrain(terrain, stereo.ground, edges, labels, parameters)


def _up(pose: CameraPose) -> NDArray[np.float64]:
    """Return the vertical in the left optical frame."""
    axes = pose.to_world(np.eye(3)) - pose.to_world(np.zeros((1, 3)))
    return np.asarray(axes[:, 2])


def _rays(camera: StereoCamera) -> NDArray[np.float64]:
    return np.stack(np.broadcast_arrays(*camera.rays(), np.float32(1)), axis=2).astype(np.float64)


def _seen(
    scene: Scene,
    ground: Ground,
    boxes: Sequence[Box],
    pose: CameraPose,
    parameters: DetectorParameters,
) -> tuple[StereoCamera, NDArray[np.float64]]:
    """Working camera, and the depth of each pixel; 0 where no ground is in range."""
    rig = scene.rig_used()
    up = tuple(_up(pose).tolist())
    plane = GroundPlane(up, rig.camera_height_m, up)
    camera = working_camera(rig.camera(scene.image_width), plane, parameters.resolution)
    origin = pose.to_world(np.zeros((1, 3)))[0]
    directions = (pose.to_world(_rays(camera).reshape(-1, 3)) - origin).astype(np.float64)
    grids = _grids(ground, boxes, origin, pose.heading_rad)
    depth_m = np.zeros(len(directions))
    flying = np.arange(len(directions))
    over_m = np.full(len(directions), rig.camera_height_m)
    before_m = 0.0
    for depth in np.geomspace(_NEAREST_M, _FARTHEST_M, _STEPS):
        place = origin + depth * directions[flying]
        height_m = place[:, 2] - _height(grids, place)
        landed = height_m <= 0
        last_m = over_m[flying[landed]]
        share = last_m / np.maximum(last_m - height_m[landed], 1e-9)
        depth_m[flying[landed]] = before_m + share * (depth - before_m)
        over_m[flying] = height_m
        flying, before_m = flying[~landed], depth
        if not flying.size:
            break
    return camera, depth_m.reshape(camera.shape)


def _grids(
    ground: Ground, boxes: Sequence[Box], origin: NDArray[np.float64], heading_rad: float
) -> tuple[_Grid, _Grid]:
    """Heights near and far, coarse first, with the boxes."""

    def grid(x_m: float, y_m: float, half_m: float, cell_m: float) -> _Grid:
        places = cell_m * np.arange(int(2 * half_m / cell_m))
        x, y = np.meshgrid(x_m - half_m + places, y_m - half_m + places)
        heights = ground.height(x.astype(np.float32), y.astype(np.float32))
        for box in boxes:
            heights = heights + box.height(x, y)
        return _Grid(x_m - half_m, y_m - half_m, cell_m, np.asarray(heights, np.float32))

    x_m, y_m = float(origin[0]), float(origin[1])
    ahead_m = _NEAR_M - 1
    return (
        grid(x_m, y_m, _FARTHEST_M, _FAR_CELL_M),
        grid(
            x_m + ahead_m * math.cos(heading_rad),
            y_m + ahead_m * math.sin(heading_rad),
            _NEAR_M,
            _NEAR_CELL_M,
        ),
    )


def _height(grids: tuple[_Grid, _Grid], place: NDArray[np.float64]) -> Image:
    (far_m, _), (near_m, inside) = (grid.read(place[:, 0], place[:, 1]) for grid in grids)
    return np.where(inside, near_m, far_m)


def _matched(
    depth_m: NDArray[np.float64],
    camera: StereoCamera,
    pose: CameraPose,
    parameters: DetectorParameters,
    generator: np.random.Generator,
) -> tuple[Stereo, NDArray[np.bool_]]:
    """Make of it what matching could make, and say where that is false.

    It is smoothed, and has correlated noise, gaps, wider edges and a few areas of false matches.
    """

    def blurred(sigma_px: float) -> Image:
        white = generator.standard_normal(camera.shape, np.float32)
        soft = cv2.GaussianBlur(white, (0, 0), sigma_px)
        return np.asarray(soft / soft.std(), np.float32)

    exact = np.where(depth_m > 0, camera.disparity_at(1.0) / np.maximum(depth_m, 0.05), 0)
    median = cv2.medianBlur(exact.astype(np.float32), 5)
    nearer = cv2.dilate(median, np.ones((3, 3))) if generator.uniform() < 0.5 else median
    disparity = cv2.GaussianBlur(median, (0, 0), generator.uniform(0.8, 2.0))
    at_edge = np.maximum(nearer - median, np.abs(disparity - median)) > _EDGE_PX
    disparity = np.where(at_edge, nearer, disparity)
    level_px = math.exp(generator.uniform(*np.log(_NOISE_PX)))
    noise_px = level_px * np.clip(np.exp(0.5 * blurred(12)), 0.4, 3)
    disparity += noise_px * blurred(generator.uniform(*_NOISE_SCALE_PX))
    is_false = _false_matches(disparity, generator)
    gaps = blurred(generator.uniform(2, 8))
    missing = (depth_m <= 0) | (gaps > np.quantile(gaps, 1 - generator.uniform(0, 0.12)))
    disparity[missing] = 0
    columns = np.arange(camera.width, dtype=np.float32)[np.newaxis]
    disparity[disparity > columns - camera.disparity_offset] = 0
    disparity = np.maximum(disparity, 0).astype(np.float32)
    claimed_px = (noise_px * math.exp(generator.normal(0, 0.25))).astype(np.float32)
    ground = _estimated_ground(disparity, camera, pose, parameters, generator)
    dark = np.zeros(camera.shape, np.uint8)
    expected = DisparityPlane.from_ground(ground, camera).disparity(camera)
    frame = Frame((dark, dark), camera)
    stereo = Stereo(frame, ground, expected, disparity, claimed_px, grey_noise=1.0, texture=0.0)
    return stereo, is_false


def _false_matches(disparity: Image, generator: np.random.Generator) -> NDArray[np.bool_]:
    """Shift the disparity of a few areas, in place, as reflections do; return where."""
    found = np.zeros(disparity.shape, np.uint8)
    height, width = disparity.shape
    for _ in range(int(generator.integers(1, 4)) if generator.uniform() < 0.35 else 0):
        area = np.zeros_like(found)
        middle = int(generator.integers(width)), int(generator.integers(height // 3, height))
        axes = (
            int(width * generator.uniform(0.01, 0.25)),
            int(height * generator.uniform(0.01, 0.1)),
        )
        cv2.ellipse(area, middle, axes, float(generator.uniform(-20, 20)), 0, 360, 1, -1)
        shift = generator.uniform(0.03, 0.4) * (1 if generator.uniform() < 0.4 else -1)
        disparity[area > 0] *= np.float32(1 + shift)
        found |= area
    return found > 0


def _on_a_box(
    depth_m: NDArray[np.float64],
    camera: StereoCamera,
    pose: CameraPose,
    ground: Ground,
    boxes: Sequence[Box],
) -> NDArray[np.bool_]:
    """Pixels that show a box."""
    found = np.zeros(depth_m.shape, np.bool_)
    if boxes:
        x, y, z = np.moveaxis(pose.to_world(_rays(camera) * depth_m[..., np.newaxis]), -1, 0)
        above_m = z - ground.height(x.astype(np.float32), y.astype(np.float32))
        for box in boxes:
            found |= (box.grown(_BOX_MARGIN_M).height(x, y) > 0) & (above_m > _BOX_MARGIN_M)
    return found


def _estimated_ground(
    disparity: Image,
    camera: StereoCamera,
    pose: CameraPose,
    parameters: DetectorParameters,
    generator: np.random.Generator,
) -> GroundPlane:
    """Find the plane as the detector does, with a vertical that is a little wrong."""
    true = _up(pose)
    usual, large = _TILT_DEG
    tilt_deg = usual if generator.uniform() < 0.7 else large
    up = true + np.cross(generator.normal(0, math.radians(tilt_deg), 3), true)
    up /= np.linalg.norm(up)
    ground = estimate_ground(disparity, camera, parameters.plane_fit, None)
    return replace(ground, up=tuple(up.tolist()))


def _labels(
    depth_m: NDArray[np.float64],
    camera: StereoCamera,
    pose: CameraPose,
    ground: Ground,
    config: DetectorConfig,
    scene: Scene,
) -> NDArray[np.uint8]:
    """Labels of each pixel, by the rules of rendered scenes."""
    truth = limits_of(config, scene.truth)
    points = pose.to_world(_rays(camera) * depth_m[..., np.newaxis])
    seen = points[(depth_m > 0) & (depth_m <= truth.range_m)]
    low, high = seen.min(0)[:2].tolist(), seen.max(0)[:2].tolist()
    local = labelling.local_ground(ground.height, low, high)
    without = np.where(depth_m > 0, depth_m, np.nan).astype(np.float32)
    no_rocks = np.zeros(camera.shape, np.uint16)
    return labelling.label(points, without, no_rocks, np.zeros(1), local, truth)
