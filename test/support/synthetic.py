"""Stereo pairs of simple scenes whose depth and obstacles are known exactly.

Each image is rendered on its own, by casting rays at planes, boxes, domes and pits. The texture is
solid: a function of the position in the world. The right image is never made from the left one.

World frame: x right, y forward, z up. The origin lies on the ground under the left camera.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity

GROUND = 0
NOTHING = -1


@dataclass(frozen=True)
class Plane:
    """Ground at ``z = height + rise_x * x + rise_y * y``.

    Several planes form their upper envelope.
    """

    rise_x: float = 0.0
    rise_y: float = 0.0
    height: float = 0.0

    @classmethod
    def uphill(cls, angle_deg: float, start_y: float = 0.0) -> Plane:
        rise = math.tan(math.radians(angle_deg))
        return cls(rise_y=rise, height=-rise * start_y)


@dataclass(frozen=True)
class Box:
    """A block standing on z = 0, or on ``base``, its sides along the axes."""

    x: float
    y: float
    width: float
    depth: float
    height: float
    base: float = 0.0


@dataclass(frozen=True)
class Dome:
    """The upper half of a ball whose centre lies at z = ``base``."""

    x: float
    y: float
    radius: float
    base: float = 0.0


@dataclass(frozen=True)
class Pit:
    """A hole with upright walls in the first plane, which must be level at z = 0."""

    x: float
    y: float
    width: float
    depth: float
    bottom: float


@dataclass(frozen=True)
class Scene:
    camera: StereoCamera
    pitch_deg: float
    height_m: float
    roll_deg: float = 0.0
    planes: tuple[Plane, ...] = (Plane(),)
    solids: tuple[Box | Dome, ...] = ()
    pits: tuple[Pit, ...] = ()
    solid_brightness: float = 0.75
    noise: float = 1.5

    @property
    def gravity(self) -> Gravity:
        return Gravity.from_angles(self.pitch_deg, self.roll_deg, self.height_m)

    def with_(self, **changes) -> Scene:
        return replace(self, **changes)


@dataclass(frozen=True, eq=False)
class View:
    """One pair, and the ground truth of the left image.

    ``surface`` is 0 on the planes; 1, 2, ... on the solids, then on the pits; -1 in the sky.
    ``height_m`` is the z of the visible point. Depth and height are NaN in the sky.
    """

    scene: Scene
    left: np.ndarray
    right: np.ndarray
    depth_m: np.ndarray
    height_m: np.ndarray
    surface: np.ndarray

    @property
    def disparity(self) -> np.ndarray:
        camera = self.scene.camera
        return np.nan_to_num(camera.fx * camera.baseline_m / self.depth_m)

    @property
    def obstacle(self) -> np.ndarray:
        return self.surface > GROUND


def pinhole(width, height, fov_deg, baseline_m, *, offset=0.0, shift=(0.0, 0.0)) -> StereoCamera:
    """Camera with square pixels; ``offset`` is the disparity at infinity."""
    focal = height / (2 * math.tan(math.radians(fov_deg) / 2))
    cx, cy = (width - 1) / 2 + shift[0], (height - 1) / 2 + shift[1]
    return StereoCamera(
        width, height, focal, focal, cx, cy, baseline_m, cx_right=cx - offset if offset else None
    )


def mast(width=320, height=240, **changes) -> Scene:
    """Look down 46 degrees from 1 m with a baseline of 0.06 m, as in the study."""
    return Scene(pinhole(width, height, 60.0, 0.06), 46.0, 1.0).with_(**changes)


def hazard_camera(width=320, height=240, **changes) -> Scene:
    """Look at the ground from 0.5 m with a wide-angle camera."""
    return Scene(pinhole(width, height, 80.0, 0.10), 35.0, 0.5).with_(**changes)


@cache
def render(scene: Scene) -> View:
    left, depth, height, surface = _image(scene, 0.0, scene.camera.cx, seed=1)
    right, *_ = _image(scene, scene.camera.baseline_m, scene.camera.cx_right, seed=2)
    view = View(scene, left, right, depth, height, surface)
    for array in (left, right, depth, height, surface):
        array.flags.writeable = False
    return view


def exposed_again(view: View, seed: int = 3) -> View:
    """The same scene with more and other noise, as in the next image of a camera at rest."""
    random = np.random.default_rng(seed)
    images = (
        np.clip(np.rint(image + random.normal(0, view.scene.noise, image.shape)), 0, 255)
        for image in (view.left, view.right)
    )
    left, right = (image.astype(np.uint8) for image in images)
    return replace(view, left=left, right=right)


def iou(mask, truth, counted=True) -> float:
    mask, truth = (mask > 0) & counted, (truth > 0) & counted
    return np.count_nonzero(mask & truth) / max(np.count_nonzero(mask | truth), 1)


def _axes(scene):
    """Camera axes (right, down, forward) in the world, as rows."""
    pitch, roll = math.radians(scene.pitch_deg), math.radians(scene.roll_deg)
    forward = np.array([0.0, math.cos(pitch), -math.sin(pitch)])
    down = np.array([0.0, -math.sin(pitch), -math.cos(pitch)])
    right = np.array([1.0, 0.0, 0.0])
    return np.stack(
        (
            math.cos(roll) * right + math.sin(roll) * down,
            -math.sin(roll) * right + math.cos(roll) * down,
            forward,
        )
    )


def _image(scene, offset_m, cx, seed):
    camera, axes = scene.camera, _axes(scene)
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    # The rays have a length of 1 along the optical axis: a multiple of a ray is a depth.
    rays = (
        ((columns - cx) / camera.fx)[..., np.newaxis] * axes[0]
        + ((rows - camera.cy) / camera.fy)[..., np.newaxis] * axes[1]
        + axes[2]
    )
    origin = np.array([0.0, 0.0, scene.height_m]) + offset_m * axes[0]
    depth, surface = _first_hit(scene, origin, rays)
    seen = np.isfinite(depth)
    points = origin + np.where(seen, depth, 0.0)[..., np.newaxis] * rays
    footprint = np.where(seen, depth, 1.0) / camera.fx
    grey = 128 + 45 * _texture(points, footprint)
    grey[surface > GROUND] *= scene.solid_brightness
    grey[~seen] = 200
    grey += np.random.default_rng(seed).normal(0, scene.noise, grey.shape)
    return (
        np.clip(np.rint(grey), 0, 255).astype(np.uint8),
        np.where(seen, depth, np.nan),
        np.where(seen, points[..., 2], np.nan),
        np.where(seen, surface, NOTHING),
    )


def _first_hit(scene, origin, rays):
    depth = np.full(rays.shape[:2], np.inf)
    surface = np.zeros(rays.shape[:2], int)

    def nearer(hit, number):
        closer = hit < depth
        depth[closer] = hit[closer]
        surface[closer] = number

    with np.errstate(divide='ignore', invalid='ignore'):
        for plane in scene.planes:
            nearer(_plane_hit(plane, origin, rays), GROUND)
        first_pit = len(scene.solids) + 1
        for number, pit in enumerate(scene.pits, first_pit):
            inner = _pit_hit(pit, origin, rays, depth)
            fallen = np.isfinite(inner)
            depth[fallen] = inner[fallen]
            surface[fallen] = number
        for number, solid in enumerate(scene.solids, 1):
            hit = _box_hit if isinstance(solid, Box) else _dome_hit
            nearer(hit(solid, origin, rays), number)
    return depth, surface


def _plane_hit(plane, origin, rays):
    normal = np.array([-plane.rise_x, -plane.rise_y, 1.0])
    hit = (plane.height - normal @ origin) / (rays @ normal)
    return np.where(hit > 0, hit, np.inf)


def _slabs(lowest, highest, origin, rays):
    one, other = (lowest - origin) / rays, (highest - origin) / rays
    return np.minimum(one, other).max(axis=-1), np.maximum(one, other).min(axis=-1)


def _box_hit(box, origin, rays):
    half = np.array([box.width / 2, box.depth / 2])
    lowest = np.array([*(np.array([box.x, box.y]) - half), -10.0])
    highest = np.array([*(np.array([box.x, box.y]) + half), box.base + box.height])
    enter, leave = _slabs(lowest, highest, origin, rays)
    return np.where((enter > 0) & (enter < leave), enter, np.inf)


def _dome_hit(dome, origin, rays):
    to_centre = np.array([dome.x, dome.y, dome.base]) - origin
    along, length = rays @ to_centre, (rays**2).sum(axis=-1)
    root = along**2 - length * (to_centre @ to_centre - dome.radius**2)
    hit = (along - np.sqrt(root)) / length
    return np.where((root > 0) & (hit > 0), hit, np.inf)


def _pit_hit(pit, origin, rays, depth):
    lowest = np.array([pit.x - pit.width / 2, pit.y - pit.depth / 2, -pit.bottom])
    highest = np.array([pit.x + pit.width / 2, pit.y + pit.depth / 2, 10.0])
    enter, leave = _slabs(lowest, highest, origin, rays)
    at_ground = origin + np.where(np.isfinite(depth), depth, 0.0)[..., np.newaxis] * rays
    fallen = ((at_ground > lowest) & (at_ground < highest))[..., :2].all(axis=-1)
    return np.where(fallen & np.isfinite(depth) & (enter < leave), leave, np.inf)


_OCTAVES_M = (0.015, 0.03, 0.06, 0.15)
_LATTICE = np.random.default_rng(0).uniform(-1, 1, (64, 64, 64)).astype(np.float32)


def _texture(points, footprint):
    """Solid value noise; octaves finer than two pixels fade out."""
    total = np.zeros(points.shape[:2], np.float32)
    for octave, cell_m in enumerate(_OCTAVES_M):
        sharp = np.clip(cell_m / (2 * footprint) - 0.5, 0, 1).astype(np.float32)
        shown = sharp > 0
        total[shown] += sharp[shown] * _value_noise(points[shown] / cell_m + 17.3 * octave)
    return total


def _value_noise(position):
    position = np.ascontiguousarray(position.T)
    corner = np.floor(position)
    weights = [(1 - share, share) for share in (position - corner).astype(np.float32)]
    # Places in the flat lattice are much faster than three indices.
    lattice = _LATTICE.ravel()
    places = [
        [((each + step) & 63) * stride for step in (0, 1)]
        for each, stride in zip(corner.astype(np.intp), (64 * 64, 64, 1), strict=True)
    ]
    total = np.zeros(position.shape[1], np.float32)
    for x, y in itertools.product((0, 1), repeat=2):
        place, weight = places[0][x] + places[1][y], weights[0][x] * weights[1][y]
        for z in (0, 1):
            total += weight * weights[2][z] * lattice[place + places[2][z]]
    return total
