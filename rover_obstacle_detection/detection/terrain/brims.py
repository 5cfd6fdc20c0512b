"""Brims: ground that ends at a drop whose face cannot be seen from above."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.noise import height_noise_m
from rover_obstacle_detection.detection.images.components import runs
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.brim_parameters import BrimParameters
from rover_obstacle_detection.detection.terrain.elevation_map import ground_axes
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Rows = NDArray[Any]


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
    level_m : ndarray of float32, shape (n,)
        Height of the ground at each brim, metres.
    edge_rows : ndarray of int, shape (n,)
        Rows of the ground before each brim that belong to its edge.
    surface : Surface
        What may lie lower.
    """

    rows: Rows
    columns: Rows
    drop_rows: Rows
    sure: Mask
    level_m: Image
    edge_rows: Rows
    surface: Surface

    def not_on(self, obstacles: Mask, parameters: BrimParameters) -> Brims:
        """Return the brims that are no rims of the given obstacles, shape (height, width).

        Matching blurs the rims, so that a brim may lie a few pixels above or beside its obstacle.
        What lies above the brim stands behind it.
        """
        reach = np.ones((2 * parameters.reach_px + 1,) * 2, np.uint8)
        reach[: parameters.reach_px] = 0
        around = cv2.dilate(obstacles.astype(np.uint8), reach) > 0
        kept = ~around[self.rows, self.columns]
        return replace(
            self,
            rows=self.rows[kept],
            columns=self.columns[kept],
            drop_rows=self.drop_rows[kept],
            sure=self.sure[kept],
            level_m=self.level_m[kept],
            edge_rows=self.edge_rows[kept],
        )

    def edge(self, parameters: BrimParameters, lengths: int = 1) -> Mask:
        """Mark the last of the ground before each sure brim, shape (height, width).

        Parameters
        ----------
        parameters : BrimParameters
        lengths : int
            How many times ``edge_m`` of the ground is marked.
        """
        sure, blur = self.sure, parameters.blur_px
        height, width = self.surface.height_m.shape
        if not sure.any():
            return np.zeros((height, width), np.bool_)
        # One more at the first row of each edge and one less after its last: sums count edges.
        change = np.zeros((height + 1, width), np.int16)
        rows, columns = self.rows[sure], self.columns[sure]
        np.add.at(change, (np.maximum(rows - blur, 0), columns), 1)
        after = np.minimum(rows + lengths * self.edge_rows[sure] + 1, len(change) - 1)
        np.add.at(change, (after, columns), -1)
        return np.asarray(np.cumsum(change[:-1], axis=0, dtype=np.int16) > 0)

    def beyond(self) -> Mask:
        """Mark the pixels behind a brim that lie lower than the rover can step.

        Returns
        -------
        ndarray of bool, shape (height, width)
        """
        found = np.zeros(self.surface.height_m.shape, np.bool_)
        if not self.rows.size:
            return found
        # Only what is above a brim in the image can be behind it.
        columns, column = np.unique(self.columns, return_inverse=True)
        last = int(self.drop_rows.max())
        above = np.s_[: last + 1, columns]
        height_m, limit_m = self.surface.height_m[above], self.surface.limit_m(above)
        # Row of the nearest brim below each pixel, counted from the last.
        nearest = np.full(height_m.shape, -1, np.intp)
        nearest[self.drop_rows, column] = last - self.drop_rows
        nearest = np.maximum.accumulate(nearest[::-1], axis=0)[::-1]
        level_m = np.full_like(height_m, np.nan)
        level_m[self.drop_rows, column] = self.level_m
        level_m = np.take_along_axis(level_m, last - np.maximum(nearest, 0), axis=0)
        with np.errstate(invalid='ignore'):
            found[above] = (nearest >= 0) & (height_m < level_m - limit_m)
        return found


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
    surface = Surface(stereo, parameters)
    below, above = surface.nearest()
    jumps = whole_brims(_jumps(surface, below, above, parameters), surface.height_m.shape, p)
    drop_rows, columns = one_in_each_fall(jumps.rows, jumps.columns, 2 * p.reach_px)
    rows = below.rows[_below_jump(drop_rows, p, len(surface.height_m)), columns]
    brim = surface.points(rows, columns)
    sure = brim.sight > math.tan(math.radians(p.min_sure_sight_deg))
    # Where matching blurs the ground just before it, a brim looks like a crest.
    rows_per_metre = surface.rows_per_metre(brim)
    sure &= p.before_m * rows_per_metre > p.reach_px
    edge_rows = np.maximum(np.rint(p.edge_m * rows_per_metre), p.edge_px).astype(np.intp)
    return Brims(rows, columns, drop_rows, sure, brim.height_m, edge_rows, surface)


class _Nearest(NamedTuple):
    """Row and height of the nearest match in one direction, each of shape (height, width).

    The last row in that direction and NaN where there is none.
    """

    rows: NDArray[np.int32]
    height_m: Image


class Surface:
    """Heights over the ground plane.

    Everything else is computed where it is needed, as hardly a pixel is near a brim.

    Attributes
    ----------
    height_m : ndarray of float32, shape (height, width)
        Over the ground plane, metres; NaN where there is no match.
    """

    def __init__(self, stereo: Stereo, parameters: TerrainParameters) -> None:
        self._stereo, self._parameters = stereo, parameters
        self._camera, self._ground = stereo.frame.camera, stereo.ground
        disparity = stereo.disparity
        missing = disparity <= self._camera.disparity_at(parameters.max_range_m)
        self.height_m = np.float32(self._ground.height_m) * (disparity - stereo.expected)
        self.height_m /= np.maximum(disparity, np.float32(1e-6))
        self.height_m[missing] = np.nan

    def nearest(self) -> tuple[_Nearest, _Nearest]:
        """Find the nearest match at or below, and at or above, each pixel in its column."""
        height, width = self.height_m.shape
        # Most pixels are their own nearest match; gaps are looked up column by column.
        missing = np.ascontiguousarray(np.isnan(self.height_m).T)
        first, last = runs(missing)
        column, row = np.divmod(np.flatnonzero(missing), height)
        gap = row * width + column

        def filled(rows_of_gaps: Rows) -> _Nearest:
            row_of_pixel = np.repeat(rows_of_gaps, last - first + 1)
            rows = np.repeat(np.arange(height, dtype=np.int32), width).reshape(height, width)
            rows.ravel()[gap] = row_of_pixel
            height_m = self.height_m.copy()
            height_m.ravel()[gap] = self.height_m[row_of_pixel, column]
            return _Nearest(rows, height_m)

        below = filled(np.minimum(last % height + 1, height - 1))
        return below, filled(np.maximum(first % height - 1, 0))

    def points(self, rows: Rows, columns: Rows) -> _Points:
        """Return the points at the given pixels."""
        camera, ground = self._camera, self._ground
        disparity = np.maximum(self._stereo.disparity[rows, columns], np.float32(1e-3))
        height_m = self.height_m[rows, columns]
        x_over_z, y_over_z = camera.rays()
        _, forward = ground_axes(ground)
        rays = forward[0] * x_over_z.ravel()[columns] + forward[1] * y_over_z.ravel()[rows]
        along_m = camera.fx * camera.baseline_m / disparity * (rays + forward[2])
        descent_m = np.maximum(np.float32(ground.height_m) - height_m, 0)
        noise_px = self._stereo.noise_px[rows, columns]
        return _Points(
            height_m,
            along_m.astype(np.float32),
            descent_m * noise_px / disparity,
            descent_m,
            np.asarray(disparity / np.float32(camera.baseline_m), np.float32),
        )

    def rows_per_metre(self, points: _Points) -> Image:
        """Image rows to a metre of level ground at the distance of each point."""
        squares = points.along_m**2 + self._ground.height_m**2
        return np.asarray(self._camera.fy * self._ground.height_m / squares, np.float32)

    def limit_m(self, where: Any) -> Image:
        """How far below a brim each of the indexed pixels is lower than a step, metres."""
        stereo, p = self._stereo, self._parameters
        camera_m = np.float32(self._ground.height_m)
        descent_m = np.maximum(camera_m - self.height_m[where], np.float32(0))
        noise_m = height_noise_m(stereo.disparity[where], descent_m, stereo.noise_px[where])
        return np.float32(p.max_step_m) + np.float32(p.brims.noises) * noise_m


@dataclass(frozen=True, eq=False)
class _Points:
    """Places over the ground plane, each of shape (n,)."""

    height_m: Image
    along_m: Image
    noise_m: Image
    descent_m: Image
    columns_per_metre: Image

    @property
    def sight(self) -> Image:
        """Slope of the sight line to each point."""
        return np.asarray(self.descent_m / np.maximum(self.along_m, np.float32(1e-3)))


class Jumps(NamedTuple):
    """Gaps that sight lines jump over, each of shape (n,).

    Parameters
    ----------
    rows, columns : ndarray of int
        Between the point before the gap and the point behind it.
    excess_m : ndarray of float32
        How much farther than a step the ground falls.
    noise_m : ndarray of float32
        Standard deviation of that.
    grazing : ndarray of float32
        Downward slope of the ground before, relative to the sight line's.
    along_m, columns_per_metre : ndarray of float32
        Distance along the plane, and image scale, of the point before.
    """

    rows: Rows
    columns: Rows
    excess_m: Image
    noise_m: Image
    grazing: Image
    along_m: Image
    columns_per_metre: Image

    def among(self, chosen: Mask) -> Jumps:
        """Return some of the jumps."""
        return Jumps(*(each[chosen] for each in self))


def _jumps(
    surface: Surface, next_below: _Nearest, next_above: _Nearest, parameters: TerrainParameters
) -> Jumps:
    """Find two points of which the upper one is lower, with hidden ground in between."""
    p = parameters.brims
    span = 2 * p.reach_px
    # NaN compares as false.
    end = max(len(surface.height_m) - span, 0)
    fall_m = next_below.height_m[span:] - next_above.height_m[:end]
    rows, columns = np.nonzero(fall_m > parameters.max_step_m)
    below, above = next_below.rows[rows + span, columns], next_above.rows[rows, columns]
    near, far = surface.points(below, columns), surface.points(above, columns)
    fallen_m = fall_m[rows, columns]
    excess_m = fallen_m - np.float32(parameters.max_step_m)
    noise_m = np.hypot(near.noise_m, far.noise_m)
    rise = _rise_before(surface, near, below, columns, p.before_m)
    # On stairs, another step may be as near as that.
    just_before = np.fmin(_rise_before(surface, near, below, columns, p.just_before_m), 0)
    grazing = -np.fmax(rise, just_before) / np.maximum(near.sight, np.float32(1e-3))
    found = below - above <= span + p.max_unseen_px
    found &= excess_m > p.pixel_noises * noise_m
    found &= fallen_m > p.min_hidden_share * near.sight * (far.along_m - near.along_m)
    found &= near.sight > math.tan(math.radians(p.min_sight_deg))
    with np.errstate(invalid='ignore'):
        found &= rise < math.tan(math.radians(p.max_rise_deg))
        found &= grazing < p.max_pixel_grazing_share
    return Jumps(
        rows + p.reach_px,
        columns,
        excess_m,
        noise_m,
        np.asarray(grazing, np.float32),
        near.along_m,
        near.columns_per_metre,
    ).among(found)


def one_in_each_fall(rows: Rows, columns: Rows, length: int) -> tuple[Rows, Rows]:
    """Keep one of the jumps in each column that show the same fall.

    Parameters
    ----------
    rows, columns : ndarray of int, shape (n,)
    length : int
        Rows in which a fall is seen.

    Returns
    -------
    rows, columns : ndarray of int, shape (m,)
        The uppermost, whose lower point is on the brim. Where falls follow one another, as on
        stairs far away, one for each length.
    """
    order = np.lexsort((rows, columns))
    rows, columns = rows[order], columns[order]
    starts = np.ones(rows.size, np.bool_)
    starts[1:] = (np.diff(columns) != 0) | (np.diff(rows) != 1)
    run = np.cumsum(starts) - 1
    first = rows[starts][run]
    last_start = first + np.maximum(np.bincount(run)[run] - length, 0)
    kept = ((rows - first) % length == 0) & (rows < last_start)
    kept |= rows == last_start
    return rows[kept], columns[kept]


def _rise_before(
    surface: Surface, points: _Points, rows: Rows, columns: Rows, before_m: float
) -> Image:
    """Rise towards each point over the ground just before it; NaN where that is not seen."""
    last = len(surface.height_m) - 1
    steps = np.maximum(np.rint(before_m * surface.rows_per_metre(points)), 3)
    before = surface.points(np.minimum(rows + steps, last).astype(np.intp), columns)
    run_m = np.maximum(points.along_m - before.along_m, np.float32(0.02))
    return np.asarray((points.height_m - before.height_m) / run_m, np.float32)


def _below_jump(drop_rows: Rows, parameters: BrimParameters, height: int) -> Rows:
    """Rows from which the nearest match downwards lies on the ground before a jump."""
    return np.asarray(np.minimum(drop_rows + parameters.reach_px, height - 1))


def whole_brims(jumps: Jumps, shape: tuple[int, ...], parameters: BrimParameters) -> Jumps:
    """Join the jumps to brims, and keep the brims that are deep, abrupt and wide enough.

    Parameters
    ----------
    jumps : Jumps
    shape : tuple of int
        Height and width of the image.
    parameters : BrimParameters

    Notes
    -----
    A brim as a whole has less noise than each of its pixels. What makes ground before a crest look
    level here and there, ripples and noise, averages out over it.
    """
    p = parameters
    if not jumps.rows.size:
        return jumps
    reach, width = 2, shape[1]
    found = np.zeros(shape, np.uint8)
    found[jumps.rows, jumps.columns] = 1
    joined = cv2.dilate(found, np.ones((2 * reach + 1,) * 2, np.uint8))
    count, labels = cv2.connectedComponents(joined, connectivity=8)
    part = np.asarray(labels)[jumps.rows, jumps.columns].astype(np.intp)
    pixels = np.maximum(np.bincount(part, minlength=count), 1)

    def mean(values: Image) -> NDArray[np.float64]:
        return np.asarray(np.bincount(part, weights=values, minlength=count) / pixels)

    left, right = np.full(count, width), np.zeros(count, np.intp)
    np.minimum.at(left, part, np.maximum(jumps.columns - reach, 0))
    np.maximum.at(right, part, np.minimum(jumps.columns + reach, width - 1))
    columns = np.maximum(right - left + 1, 1)
    samples = np.maximum(columns / p.shared_px, 1)
    kept = mean(jumps.excess_m) > p.noises * mean(jumps.noise_m) / np.sqrt(samples)
    kept &= _medians(jumps.grazing, part, count) < p.max_grazing_share
    width_m = columns / np.maximum(mean(jumps.columns_per_metre), 1e-6)
    kept &= width_m >= np.maximum(p.min_width_m, p.min_width_share * mean(jumps.along_m))
    return jumps.among(kept[part])


def _medians(values: Image, part: Rows, count: int) -> Image:
    """Median of the values of each of the parts; 0 of those without any."""
    medians = np.zeros(count, np.float32)
    order = np.lexsort((values, part))
    pixels = np.bincount(part, minlength=count)
    filled = pixels > 0
    middle = np.cumsum(pixels) - pixels + pixels // 2
    medians[filled] = values[order][middle[filled]]
    return medians
