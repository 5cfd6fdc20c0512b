"""Brims: ground that ends at a drop whose face cannot be seen from above."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.noise import height_noise_m
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.elevation_map import plane_coordinates
from rover_obstacle_detection.detection.terrain.parameters import BrimParameters, TerrainParameters

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Brims:
    """Where the ground ends.

    Parameters
    ----------
    rows, columns : ndarray of int, shape (n,)
        The last pixel of the ground before each brim.
    drop_rows : ndarray of int, shape (n,)
        Row of each brim: above it in its column lies what is behind.
    sure : ndarray of bool, shape (n,)
        Brims that are seen steeply enough to tell them from the crest of gentle ground.
    level_m, limit_m : ndarray of float32, shape (n,) and (height, width)
        Height of the ground at each brim, and how far below it a pixel is lower than the rover can
        step, noise included, metres.
    height_m : ndarray of float32, shape (height, width)
        Height of each pixel over the ground plane, metres; NaN where there is no match.
    """

    rows: Rows
    columns: Rows
    drop_rows: Rows
    sure: Mask
    level_m: Image
    limit_m: Image
    height_m: Image

    def not_on(self, obstacles: Mask) -> Brims:
        """Return the brims that are no rims of the given obstacles, shape (height, width)."""
        kept = ~obstacles[self.rows, self.columns]
        return replace(
            self,
            rows=self.rows[kept],
            columns=self.columns[kept],
            drop_rows=self.drop_rows[kept],
            sure=self.sure[kept],
            level_m=self.level_m[kept],
        )

    def edge(self, parameters: BrimParameters) -> Mask:
        """Mark the last few pixels of the ground before each sure brim, shape (height, width)."""
        edge = np.zeros(self.height_m.shape, np.bool_)
        rows, columns = self.rows[self.sure], self.columns[self.sure]
        for step in range(-parameters.blur_px, parameters.edge_px + 1):
            edge[np.clip(rows + step, 0, len(edge) - 1), columns] = True
        return edge

    def beyond(self) -> Mask:
        """Mark the pixels behind a brim that lie lower than the rover can step.

        Returns
        -------
        ndarray of bool, shape (height, width)
        """
        if not self.rows.size:
            return np.zeros(self.height_m.shape, np.bool_)
        last = len(self.height_m) - 1
        # Row of the nearest brim below each pixel, counted from the bottom.
        nearest = np.full(self.height_m.shape, -1, np.intp)
        nearest[self.drop_rows, self.columns] = last - self.drop_rows
        nearest = np.maximum.accumulate(nearest[::-1], axis=0)[::-1]
        level_m = np.full_like(self.height_m, np.nan)
        level_m[self.drop_rows, self.columns] = self.level_m
        level_m = np.take_along_axis(level_m, np.clip(last - nearest, 0, last), axis=0)
        with np.errstate(invalid='ignore'):
            return np.asarray((nearest >= 0) & (self.height_m < level_m - self.limit_m))


def find_brims(stereo: Stereo, parameters: TerrainParameters) -> Brims:
    """Find where sight lines jump over a gap to something lower.

    Parameters
    ----------
    stereo : Stereo
    parameters : TerrainParameters

    Notes
    -----
    From one image row to the next, the sight line moves on by a little ground. At a brim it leaves
    the ground and meets it again farther away and lower. The points before and after lie nearly on
    one sight line, so the slope between them is that of the sight line itself. Ground that bends
    down gradually is seen ever more obliquely before it vanishes: that is a crest, no brim. The
    top of a rock is no brim either, as it rises just before it ends.
    """
    p = parameters.brims
    surface = _Surface.measured(stereo, parameters)
    found = np.zeros(stereo.disparity.shape, np.bool_)
    if len(found) > 2 * p.reach_px:
        found = _wide_enough(_jumps(surface, parameters), surface, parameters)
    # Of each run of rows found, the uppermost has its lower point on the brim.
    found[1:] &= ~found[:-1]
    drop_rows, columns = np.nonzero(found)
    rows = surface.next_below[np.minimum(drop_rows + p.reach_px, len(found) - 1), columns]
    limit_m = np.float32(parameters.max_step_m) + np.float32(p.noises) * surface.noise_m
    level_m = surface.height_m[rows, columns]
    sight = (np.float32(surface.camera_m) - level_m) / np.maximum(
        surface.along_m[rows, columns], 1e-3
    )
    sure = sight > math.tan(math.radians(p.min_sure_sight_deg))
    return Brims(rows, columns, drop_rows, sure, level_m, limit_m, surface.height_m)


@dataclass(frozen=True, eq=False)
class _Surface:
    """Each pixel's place over the ground plane, metres; NaN without a match.

    `next_below` and `next_above` are the rows of the nearest match at or below and at or above
    each pixel, or the last row and the first.
    """

    height_m: Image
    along_m: Image
    noise_m: Image
    camera_m: float
    rows_per_metre: Image
    columns_per_metre: Image
    next_below: Rows
    next_above: Rows

    @classmethod
    def measured(cls, stereo: Stereo, parameters: TerrainParameters) -> _Surface:
        camera, ground, disparity = stereo.frame.camera, stereo.ground, stereo.disparity
        in_range = disparity > camera.disparity_at(parameters.max_range_m)
        height_m = np.full_like(disparity, np.nan)
        np.divide(
            np.float32(ground.height_m) * (disparity - stereo.expected),
            disparity,
            out=height_m,
            where=in_range,
        )
        along_m = plane_coordinates(disparity, camera, ground)[1]
        descent_m = np.maximum(np.float32(ground.height_m) - height_m, np.float32(0))
        noise_m = height_noise_m(disparity, descent_m, stereo.noise_px)
        # Level ground at the distance a is seen under the slope H / a.
        squares = along_m * along_m + np.float32(ground.height_m**2)
        rows_per_metre = np.float32(camera.fy * ground.height_m) / np.maximum(squares, 1e-6)
        row = np.arange(len(disparity), dtype=np.intp)[:, np.newaxis]
        below = np.where(in_range, row, len(disparity) - 1)
        above = np.where(in_range, row, 0)
        return cls(
            height_m,
            along_m,
            noise_m,
            ground.height_m,
            np.asarray(rows_per_metre, np.float32),
            disparity / np.float32(camera.baseline_m),
            np.minimum.accumulate(below[::-1], axis=0)[::-1],
            np.maximum.accumulate(above, axis=0),
        )


def _jumps(surface: _Surface, parameters: TerrainParameters) -> Mask:
    """Rows between two points of which the upper one is lower, and hidden in between."""
    p = parameters.brims
    found = np.zeros(surface.height_m.shape, np.bool_)
    inner = found[p.reach_px : -p.reach_px]
    near = surface.next_below[2 * p.reach_px :]
    far = surface.next_above[: -2 * p.reach_px]
    near_m, far_m, near_along_m, far_along_m, near_noise_m, far_noise_m = (
        np.take_along_axis(image, row, axis=0)
        for image in (surface.height_m, surface.along_m, surface.noise_m)
        for row in (near, far)
    )
    fall_m, gap_m = near_m - far_m, far_along_m - near_along_m
    sight = (np.float32(surface.camera_m) - near_m) / np.maximum(near_along_m, np.float32(1e-3))
    limit_m = parameters.max_step_m + p.noises * np.hypot(near_noise_m, far_noise_m)
    with np.errstate(invalid='ignore'):
        inner |= fall_m > limit_m
        inner &= fall_m > p.min_hidden_share * sight * gap_m
        inner &= sight > math.tan(math.radians(p.min_sight_deg))
    inner &= near - far <= 2 * p.reach_px + p.max_unseen_px
    rows, columns = np.nonzero(inner)
    rise = _rise_before(surface, near[rows, columns], columns, p.before_m)
    level = rise < math.tan(math.radians(p.max_rise_deg))
    level &= -rise < p.max_grazing_share * sight[rows, columns]
    inner[rows[~level], columns[~level]] = False
    return found


def _rise_before(
    surface: _Surface, rows: NDArray[np.intp], columns: NDArray[np.intp], before_m: float
) -> Image:
    """Rise towards each pixel over the ground just before it; NaN where that is not seen."""
    last = surface.height_m.shape[0] - 1
    steps = np.rint(before_m * surface.rows_per_metre[rows, columns])
    below = np.minimum(rows + np.maximum(steps, 3), last).astype(np.intp)
    rise_m = surface.height_m[rows, columns] - surface.height_m[below, columns]
    run_m = surface.along_m[rows, columns] - surface.along_m[below, columns]
    return np.asarray(rise_m / np.maximum(run_m, np.float32(0.02)), np.float32)


def _wide_enough(found: Mask, surface: _Surface, parameters: TerrainParameters) -> Mask:
    """Keep the brims that are at least as wide as a wheel, and wider far away."""
    p = parameters.brims
    joined = cv2.dilate(found.astype(np.uint8), np.ones((5, 5), np.uint8))
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    pixels = np.maximum(np.bincount(labels[found], minlength=count), 1)
    scale, along_m = (
        np.bincount(labels[found], weights=image[found], minlength=count) / pixels
        for image in (surface.columns_per_metre, surface.along_m)
    )
    width_m = boxes[:, cv2.CC_STAT_WIDTH] / np.maximum(scale, 1e-6)
    kept = width_m >= np.maximum(p.min_width_m, p.min_width_share * along_m)
    kept[0] = False
    return np.asarray(found & kept[labels])
