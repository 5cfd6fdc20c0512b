"""A hazard in front of a rover: a ray-cast pair and what must be said of each of its pixels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np
from raycast import NOTHING, cast
from surfaces import (
    BLIND,
    BRIM,
    DAYLIGHT,
    FREE,
    OBSTACLE,
    UNCOUNTED,
    Light,
    Rig,
    Surface,
)

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity

# Of images with 480 rows.
MARGIN_PX = 3
BAND_PX = 12
# The longest edge of a brim, see `BrimParameters`.
EDGE_M = 0.2
COVER_MARGIN_PX = 24
ROWS = 480
# Free ground counts up to this many camera heights, and down to this disparity with 480 rows.
COUNTED_HEIGHTS = 8.0
COUNTED_DISPARITY_PX = 8.0
# Obstacles count somewhat farther: they stand up from the ground.
OBSTACLE_RANGE = 1.5


@dataclass(frozen=True)
class Band:
    """A line in the world near which each column needs an obstacle.

    With ``hides``, the line is the brim of a drop, and nothing counts above it in the image.
    """

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    hides: bool = True


@dataclass(frozen=True)
class Fault:
    """A fault of the cameras, and what it changes about what is expected.

    ``apply`` takes and returns the left and the right image. ``expect_all`` replaces what is
    expected of each pixel that counts. ``half_covered`` names the image whose right half shows
    nothing. With ``upside_down``, what the right camera saw is shown turned by 180 degrees on the
    left.
    """

    apply: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None
    expect_all: int | None = None
    half_covered: str = ''
    upside_down: bool = False


NO_FAULT = Fault()


@dataclass(frozen=True, eq=False)
class View:
    """The pair of a scene, and the truth of the left image.

    ``expected`` holds: 0 must not be an obstacle; 1 obstacle; 2 must not be free; 3 each column
    needs an obstacle; 4 cannot be judged; 255 does not count. ``depth_m`` is NaN in the sky;
    on a mirror it is that of the mirror. ``surface`` numbers the scene's surfaces from 0.
    """

    left: np.ndarray
    right: np.ndarray
    expected: np.ndarray
    depth_m: np.ndarray
    surface: np.ndarray


@dataclass(frozen=True, eq=False)
class HazardScene:
    """A scene, its true pose, and how the detector is configured for it.

    ``range_m`` is the distance of the hazard ahead of the camera, along the ground. The right
    image is taken after the rover moved so far right and ahead. With ``may_refuse``, an error is
    as good as an answer.
    """

    name: str
    rig: Rig
    surfaces: tuple[Surface, ...]
    bands: tuple[Band, ...] = ()
    range_m: float = float('nan')
    light: Light = DAYLIGHT
    seed: int = 0
    config: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    may_refuse: bool = False
    fault: Fault = NO_FAULT
    right_moved_m: tuple[float, float] = (0.0, 0.0)

    @property
    def kind(self) -> str:
        return self.name.split('_')[0]

    @property
    def camera(self) -> StereoCamera:
        return self.rig.camera

    @property
    def pitch_deg(self) -> float:
        return self.rig.pitch_deg

    @property
    def height_m(self) -> float:
        return self.rig.height_m

    @property
    def gravity(self) -> Gravity:
        gravity = self.rig.gravity
        if self.fault.upside_down:
            x, y, z = gravity.up
            return replace(gravity, up=(-x, -y, z))
        return gravity

    def with_(self, **changes) -> HazardScene:
        return replace(self, **changes)

    def with_noise(self, grey_levels: float) -> HazardScene:
        return self.with_(light=replace(self.light, noise=grey_levels))

    def resized(self, width: int) -> HazardScene:
        """Return the same scene in smaller or larger images."""
        return self.with_(rig=self.rig.resized(width))

    def render(self) -> View:
        return _render(self)


@lru_cache(maxsize=8)
def _render(scene: HazardScene) -> View:
    pair = cast(scene.rig, scene.surfaces, scene.light, scene.seed, scene.right_moved_m)
    left, right, fault = pair.left, pair.right, scene.fault
    depth_m, surface = pair.depth_m, pair.surface
    if fault.upside_down:
        depth_m, surface = pair.right_depth_m, pair.right_surface
    expected = expected_values(scene, depth_m, surface)
    if fault.expect_all is not None:
        expected[expected != UNCOUNTED] = fault.expect_all
    if fault.half_covered:
        _cover(expected, scene, depth_m)
    if fault.apply:
        left, right = fault.apply(left, right)
    if fault.upside_down:
        expected, depth_m, surface = (
            np.ascontiguousarray(each[::-1, ::-1]) for each in (expected, depth_m, surface)
        )
    view = View(left, right, expected, depth_m, surface)
    for array in vars(view).values():
        array.flags.writeable = False
    return view


def _cover(expected: np.ndarray, scene: HazardScene, depth_m: np.ndarray) -> None:
    """Expect nothing of what the covered half of the left or right image would show."""
    camera = scene.camera
    column = np.broadcast_to(np.arange(camera.width, dtype=float), expected.shape)
    if scene.fault.half_covered == 'right':
        column = column - np.nan_to_num(camera.fx * camera.baseline_m / depth_m)
    beyond = column - camera.width // 2
    expected[(beyond >= 0) & (expected != UNCOUNTED)] = BLIND
    expected[np.abs(beyond) < COVER_MARGIN_PX * camera.height / ROWS] = UNCOUNTED


def expected_values(scene: HazardScene, depth_m: np.ndarray, surface: np.ndarray) -> np.ndarray:
    """Compute what must be said of each pixel, from what it shows."""
    values = np.array([each.expect for each in scene.surfaces] + [UNCOUNTED], np.uint8)
    shown = values[surface]
    expected = shown.copy()
    camera = scene.camera
    scale = camera.height / ROWS
    counted_m = min(COUNTED_HEIGHTS * scene.height_m, camera.depth_m(COUNTED_DISPARITY_PX * scale))
    depth = np.where(surface == NOTHING, np.inf, depth_m)
    unseen_right = np.arange(camera.width) < camera.fx * camera.baseline_m / depth
    expected[(shown == FREE) & ((depth > counted_m) | unseen_right)] = UNCOUNTED
    expected[(shown == OBSTACLE) & (depth > OBSTACLE_RANGE * counted_m)] = UNCOUNTED
    size = 2 * max(round(MARGIN_PX * scale), 1) + 1
    kernel = np.ones((size, size), np.uint8)
    expected[cv2.dilate(shown, kernel) != cv2.erode(shown, kernel)] = UNCOUNTED
    for band in scene.bands:
        _draw_band(expected, band, scene, depth)
    return expected


def band_px(rig: Rig) -> int:
    """Half the height of a band, pixels.

    Nothing counts up to twice as far from its line, nor `EDGE_M` before it.
    """
    return max(round(BAND_PX * rig.height / ROWS), 3)


def _draw_band(expected: np.ndarray, band: Band, scene: HazardScene, depth: np.ndarray) -> None:
    half = band_px(scene.rig)
    rows = np.arange(scene.rig.height)[:, np.newaxis]
    line = _rows_of(band, scene.rig, depth)
    before = _rows_of(_nearer(band), scene.rig, depth)
    seen = np.isfinite(line)
    with np.errstate(invalid='ignore'):
        near = np.abs(rows - line) < 2 * half
        near |= (rows > line) & (rows < before)
        if band.hides:
            near |= rows < line
        expected[near & seen] = UNCOUNTED
        expected[(np.abs(rows - line) < half) & seen] = BRIM


def _nearer(band: Band) -> Band:
    """The same line, nearer to the camera by the longest edge of a brim."""
    start, end = np.asarray(band.start), np.asarray(band.end)
    across = np.array([end[1] - start[1], start[0] - end[0], 0.0])
    across *= EDGE_M / np.linalg.norm(across)
    if start @ across < 0:
        across = -across
    return Band(tuple(start - across), tuple(end - across))


def _rows_of(band: Band, rig: Rig, depth: np.ndarray) -> np.ndarray:
    """Row of the line in each column, NaN where it is outside the image or hidden."""
    camera = rig.camera
    start, end = (rig.in_camera(np.asarray(point)) for point in (band.start, band.end))
    x_over_z = camera.rays()[0].ravel().astype(float)
    along = end - start
    with np.errstate(divide='ignore', invalid='ignore'):
        share = (x_over_z * start[2] - start[0]) / (along[0] - x_over_z * along[2])
        z = start[2] + share * along[2]
        rows = camera.cy + camera.fy * (start[1] + share * along[1]) / z
    seen = (share >= 0) & (share <= 1) & (z > 0) & (rows >= 0) & (rows <= rig.height - 1)
    # The line is seen where the image shows nothing nearer just below it.
    below = np.clip(np.nan_to_num(rows) + 2, 0, rig.height - 1).astype(int)
    seen &= z < 1.1 * depth[below, np.arange(rig.width)]
    return np.where(seen, rows, np.nan)
