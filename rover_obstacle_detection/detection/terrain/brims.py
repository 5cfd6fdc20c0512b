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
    find_jumps,
    one_in_each_fall,
    whole_brims,
)
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.surface import Surface

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

    def beside(self, parameters: BrimParameters) -> Mask:
        """Mark the ground beside sure brims that run along the view, shape (height, width).

        From one column to the next, such a brim goes on over many rows.
        """
        height, width = self.surface.height_m.shape
        beside = np.zeros((height, width), np.uint8)
        columns, rows = self.columns[self.sure], self.rows[self.sure]
        brim = self.surface.points(rows, columns)
        reach = np.minimum(np.rint(parameters.edge_m * brim.columns_per_metre), width)
        first, second = _neighbours(rows, columns, parameters.reach_px)
        joined = np.abs(brim.along_m[second] - brim.along_m[first]) < parameters.max_gap_m
        # Across the view, the edges before the brims are enough.
        joined &= np.abs(rows[second] - rows[first]) > columns[second] - columns[first]
        places = list(zip(columns.tolist(), rows.tolist(), strict=True))
        for i, j in zip(first[joined].tolist(), second[joined].tolist(), strict=True):
            cv2.line(beside, places[i], places[j], 1, 2 * int(max(reach[i], reach[j])) + 1)
        return beside > 0

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
    jumps = whole_brims(find_jumps(surface, below, above, parameters), surface.height_m.shape, p)
    drop_rows, columns = one_in_each_fall(jumps.rows, jumps.columns, 2 * p.reach_px)
    rows = below.rows[_below_jump(drop_rows, p, len(surface.height_m)), columns]
    # Where rows have no match, several jumps show the same brim.
    _, once = np.unique(columns * len(surface.height_m) + rows, return_index=True)
    rows, columns, drop_rows = rows[once], columns[once], drop_rows[once]
    brim = surface.points(rows, columns)
    sure = brim.sight > math.tan(math.radians(p.min_sure_sight_deg))
    # Where matching blurs the ground just before it, a brim looks like a crest.
    rows_per_metre = surface.rows_per_metre(brim)
    sure &= p.before_m * rows_per_metre > p.reach_px
    edge_rows = np.maximum(np.rint(p.edge_m * rows_per_metre), p.edge_px).astype(np.intp)
    return Brims(rows, columns, drop_rows, sure, brim.height_m, edge_rows, surface)


def _below_jump(drop_rows: Rows, parameters: BrimParameters, height: int) -> Rows:
    """Rows from which the nearest match downwards lies on the ground before a jump."""
    return np.asarray(np.minimum(drop_rows + parameters.reach_px, height - 1))


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
