"""Brims: ground that ends at a drop whose face cannot be seen from above."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.brim_parameters import BrimParameters
from rover_obstacle_detection.detection.terrain.jumps import (
    Jumps,
    find_jumps,
    one_in_each_fall,
    whole_brims,
)
from rover_obstacle_detection.detection.terrain.parameters import LEDGE_RUN, TerrainParameters
from rover_obstacle_detection.detection.terrain.surface import Nearest, Surface

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Rows = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Brims:
    """Where the ground ends, or may end.

    Parameters
    ----------
    rows, columns : ndarray of int, shape (n,)
        The last pixel of the ground before each brim.
    drop_rows : ndarray of int, shape (n,)
        Row of each brim: above it in its column lies what is behind.
    deep : ndarray of bool, shape (n,)
        Brims over which the ground is seen to fall by more than a step.
    sure : ndarray of bool, shape (n,)
        Deep brims that are seen steeply, and in rows, enough to tell them from the crest of gentle
        ground.
    level_m : ndarray of float32, shape (n,)
        Height of the ground at each brim, metres.
    edge_m : ndarray of float32, shape (n,)
        Length of the ground before each brim that belongs to its edge, metres.
    edge_rows : ndarray of int, shape (n,)
        Rows of the image that show that ground, at least `edge_px`.
    surface : Surface
        What may lie lower.
    """

    rows: Rows
    columns: Rows
    drop_rows: Rows
    deep: Mask
    sure: Mask
    level_m: Image
    edge_m: Image
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
        return self.among(~around[self.rows, self.columns])

    def doubted(self, sparse: Mask, parameters: BrimParameters) -> Brims:
        """Return the same brims, not sure where most of the ground before one is sparse.

        Where chance supports matches, noise makes brims of any depth.

        Parameters
        ----------
        sparse : ndarray of bool, shape (height, width)
        parameters : BrimParameters
        """
        before = np.minimum(self.rows + parameters.support_px, len(sparse) - 1)
        _, labels = cv2.connectedComponents(self.edge(parameters).astype(np.uint8))
        part = np.asarray(labels)[self.rows, self.columns]
        pixels = np.bincount(part)
        share = np.bincount(part, weights=sparse[before, self.columns]) / np.maximum(pixels, 1)
        return replace(self, sure=self.sure & (share < parameters.max_sparse_share)[part])

    def among(self, chosen: Mask) -> Brims:
        """Return some of the brims."""
        return replace(
            self,
            rows=self.rows[chosen],
            columns=self.columns[chosen],
            drop_rows=self.drop_rows[chosen],
            deep=self.deep[chosen],
            sure=self.sure[chosen],
            level_m=self.level_m[chosen],
            edge_m=self.edge_m[chosen],
            edge_rows=self.edge_rows[chosen],
        )

    def edge(self, parameters: BrimParameters) -> Mask:
        """Mark the last of the ground before each sure brim, shape (height, width)."""
        return self._before(self.sure, 1, parameters)

    def near(self, parameters: BrimParameters) -> Mask:
        """Mark the ground that is never free, shape (height, width).

        It is twice as long before each brim as its edge. Beside a brim that runs along the view,
        it is as wide as the edge.
        """
        every = np.ones_like(self.sure)
        return self._before(every, 2, parameters) | self._beside(parameters)

    def _before(self, chosen: Mask, lengths: int, parameters: BrimParameters) -> Mask:
        """Mark ``lengths`` times the edge rows of the ground before the chosen brims."""
        blur = parameters.blur_px
        height, width = self.surface.height_m.shape
        if not chosen.any():
            return np.zeros((height, width), np.bool_)
        # One more at the first row of each edge and one less after its last: sums count edges.
        change = np.zeros((height + 1, width), np.int16)
        rows, columns = self.rows[chosen], self.columns[chosen]
        np.add.at(change, (np.maximum(rows - blur, 0), columns), 1)
        after = np.minimum(rows + lengths * self.edge_rows[chosen] + 1, len(change) - 1)
        np.add.at(change, (after, columns), -1)
        return np.asarray(np.cumsum(change[:-1], axis=0, dtype=np.int16) > 0)

    def _beside(self, parameters: BrimParameters) -> Mask:
        """Mark the ground beside brims that run along the view.

        From one column to the next, such a brim goes on over many rows.
        """
        height, width = self.surface.height_m.shape
        beside = np.zeros((height, width), np.uint8)
        rows, columns = self.rows, self.columns
        brim = self.surface.points(rows, columns)
        reach = np.minimum(np.rint(self.edge_m * brim.columns_per_metre), width)
        first, second = _neighbours(rows, columns, parameters.reach_px)
        joined = np.abs(brim.along_m[second] - brim.along_m[first]) < parameters.max_gap_m
        # Across the view, the edges before the brims are enough.
        joined &= np.abs(rows[second] - rows[first]) > columns[second] - columns[first]
        places = list(zip(columns.tolist(), rows.tolist(), strict=True))
        for i, j in zip(first[joined].tolist(), second[joined].tolist(), strict=True):
            cv2.line(beside, places[i], places[j], 1, 2 * int(max(reach[i], reach[j])) + 1)
        return beside > 0

    def beyond(self) -> Mask:
        """Mark the pixels behind a deep brim that lie lower than the rover can step.

        Returns
        -------
        ndarray of bool, shape (height, width)
        """
        found = np.zeros(self.surface.height_m.shape, np.bool_)
        deep = self.among(self.deep)
        if not deep.rows.size:
            return found
        # Only what is above a brim in the image can be behind it.
        columns, column = np.unique(deep.columns, return_inverse=True)
        last = int(deep.drop_rows.max())
        above = np.s_[: last + 1, columns]
        height_m, limit_m = self.surface.height_m[above], self.surface.limit_m(above)
        # Row of the nearest brim below each pixel, counted from the last.
        nearest = np.full(height_m.shape, -1, np.intp)
        nearest[deep.drop_rows, column] = last - deep.drop_rows
        nearest = np.maximum.accumulate(nearest[::-1], axis=0)[::-1]
        level_m = np.full_like(height_m, np.nan)
        level_m[deep.drop_rows, column] = deep.level_m
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
    jumps = find_jumps(surface, below, above, parameters)
    found = [
        _places(whole_brims(jumps, least_m, surface.height_m.shape, p), below, p)
        for least_m in (parameters.max_step_m, p.possible_share * parameters.max_step_m)
    ]
    rows, columns, drop_rows = np.concatenate(found, axis=1)
    deep = np.arange(rows.size) < found[0].shape[1]
    # Several jumps may show the same brim. Deep ones come first, so `np.unique` keeps them.
    _, once = np.unique(columns * len(surface.height_m) + rows, return_index=True)
    rows, columns, drop_rows, deep = (each[once] for each in (rows, columns, drop_rows, deep))
    brim = surface.points(rows, columns)
    sure = deep & (brim.sight > math.tan(math.radians(p.min_sure_sight_deg)))
    # Where matching blurs the ground just before it, a brim looks like a crest.
    rows_per_metre = surface.rows_per_metre(brim)
    sure &= p.before_m * rows_per_metre > p.reach_px
    fall_m = brim.height_m - above.height_m[np.maximum(drop_rows - 1, 0), columns]
    edge_m = steep_length_m(fall_m, parameters)
    edge_rows = np.maximum(np.rint(edge_m * rows_per_metre), p.edge_px).astype(np.intp)
    return Brims(rows, columns, drop_rows, deep, sure, brim.height_m, edge_m, edge_rows, surface)


def steep_length_m(fall_m: Image, parameters: TerrainParameters) -> Image:
    """How far before a fall the smoothed ground is steeper than `max_slope_deg`, within `edge_m`.

    A Gaussian of standard deviation ``s``, the first of `rise_scales_m`, turns a fall of ``h``
    into a slope of ``h exp(-x^2 / 2 s^2) / (sqrt(2 pi) s)`` at a distance of ``x``.

    Parameters
    ----------
    fall_m : ndarray of float32, shape (n,)
        Metres; NaN where the fall is not seen.
    parameters : TerrainParameters

    Returns
    -------
    ndarray of float32, shape (n,)
        Metres.
    """
    scale_m = parameters.rise_scales_m[0]
    limit = max(math.tan(math.radians(parameters.max_slope_deg)), 1e-6)
    steepness = fall_m / np.float32(LEDGE_RUN * scale_m * limit)
    length_m = scale_m * np.sqrt(2 * np.log(np.fmax(steepness, np.float32(1))))
    return np.asarray(np.clip(length_m, *parameters.brims.edge_m), np.float32)


def _places(jumps: Jumps, below: Nearest, parameters: BrimParameters) -> Rows:
    """Rows and columns of the last ground before each fall, and rows of the falls."""
    p = parameters
    drop_rows, columns = one_in_each_fall(jumps.rows, jumps.columns, 2 * p.reach_px)
    # The nearest match downwards lies on the ground before a jump.
    start = np.minimum(drop_rows + p.reach_px, len(below.rows) - 1)
    return np.stack((below.rows[start, columns], columns, drop_rows)).astype(np.intp)


def _neighbours(rows: Rows, columns: Rows, reach_px: int) -> tuple[Rows, Rows]:
    """For each brim, the nearest in the next column to the right that has any within reach.

    Returns
    -------
    first, second : ndarray of int, shape (m,)
        Indices of the brims that have one, and of those.
    """
    height = int(rows.max(initial=0)) + 1
    order = np.lexsort((rows, columns))
    places = (columns * height + rows)[order]
    first, second = np.zeros((2, 0), np.intp)
    alone = np.arange(rows.size)
    for across in range(1, reach_px + 1):
        after = np.searchsorted(places, (columns + across)[alone] * height + rows[alone])
        off = np.full((2, alone.size), height)
        for side, index in zip(off, (after - 1, after), strict=True):
            there = (index >= 0) & (index < rows.size)
            there[there] = columns[order[index[there]]] == columns[alone[there]] + across
            side[there] = np.abs(rows[order[index[there]]] - rows[alone[there]])
        found = off.min(axis=0) < height
        nearest = np.where(off[0] < off[1], after - 1, after)[found]
        first = np.concatenate((first, alone[found]))
        second = np.concatenate((second, order[nearest]))
        alone = alone[~found]
    return first, second
