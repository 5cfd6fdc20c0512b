"""Gaps that sight lines jump over, from ground to something lower."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.terrain.brim_parameters import BrimParameters
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.surface import Nearest, Points, Surface

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Rows = NDArray[Any]


class Jumps(NamedTuple):
    """Gaps that sight lines jump over, each of shape (n,).

    Parameters
    ----------
    rows, columns : ndarray of int
        Between the point before the gap and the point behind it.
    fall_m : ndarray of float32
        How far the ground falls.
    noise_m : ndarray of float32
        Standard deviation of that.
    grazing : ndarray of float32
        Downward slope of the ground before, relative to the sight line's.
    along_m, columns_per_metre : ndarray of float32
        Distance along the plane, and image scale, of the point before.
    """

    rows: Rows
    columns: Rows
    fall_m: Image
    noise_m: Image
    grazing: Image
    along_m: Image
    columns_per_metre: Image

    def among(self, chosen: Mask) -> Jumps:
        """Return some of the jumps."""
        return Jumps(*(each[chosen] for each in self))


def find_jumps(
    surface: Surface, next_below: Nearest, next_above: Nearest, parameters: TerrainParameters
) -> Jumps:
    """Find pairs of points of which the upper is lower, with the ground between them hidden.

    A fall from ``possible_share`` of a step counts: it may be deeper where it is hidden.

    Parameters
    ----------
    surface : Surface
    next_below, next_above : Nearest
        From `Surface.nearest`.
    parameters : TerrainParameters
    """
    p = parameters.brims
    span = 2 * p.reach_px
    # NaN compares as false.
    end = max(len(surface.height_m) - span, 0)
    fall_m = next_below.height_m[span:] - next_above.height_m[:end]
    rows, columns = np.nonzero(fall_m > p.possible_share * parameters.max_step_m)
    below, above = next_below.rows[rows + span, columns], next_above.rows[rows, columns]
    near, far = surface.points(below, columns), surface.points(above, columns)
    fallen_m = fall_m[rows, columns]
    hidden = below - above <= span + p.max_unseen_px
    hidden &= fallen_m > p.min_hidden_share * near.sight * (far.along_m - near.along_m)
    hidden &= near.sight > math.tan(math.radians(p.min_sight_deg))
    rows, columns, below = rows[hidden], columns[hidden], below[hidden]
    fallen_m, near, far = fallen_m[hidden], near.among(hidden), far.among(hidden)
    rise = _rise_before(surface, near, below, columns, p.before_m)
    # On stairs, another step may be nearer than that. What is not seen is not level.
    just_before = np.minimum(_rise_before(surface, near, below, columns, p.just_before_m), 0)
    grazing = -np.fmax(rise, just_before) / np.maximum(near.sight, np.float32(1e-3))
    with np.errstate(invalid='ignore'):
        abrupt = rise < math.tan(math.radians(p.max_rise_deg))
        abrupt &= grazing < p.max_pixel_grazing_share
    return Jumps(
        rows + p.reach_px,
        columns,
        fallen_m,
        np.hypot(near.noise_m, far.noise_m),
        np.asarray(grazing, np.float32),
        near.along_m,
        near.columns_per_metre,
    ).among(abrupt)


def one_in_each_fall(rows: Rows, columns: Rows, length: int) -> tuple[Rows, Rows]:
    """Keep one of the jumps in each column that show the same fall.

    Parameters
    ----------
    rows, columns : ndarray of int, shape (n,)
    length : int
        Rows in which a fall is seen, where none of them is without a match.

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
    surface: Surface, points: Points, rows: Rows, columns: Rows, before_m: float
) -> Image:
    """Rise towards each point over the ground just before it; NaN where that is not seen."""
    last = len(surface.height_m) - 1
    steps = np.maximum(np.rint(before_m * surface.rows_per_metre(points)), 3)
    before = surface.points(np.minimum(rows + steps, last).astype(np.intp), columns)
    run_m = np.maximum(points.along_m - before.along_m, np.float32(0.02))
    return np.asarray((points.height_m - before.height_m) / run_m, np.float32)


def whole_brims(
    jumps: Jumps, least_m: float, shape: tuple[int, ...], parameters: BrimParameters
) -> Jumps:
    """Join the jumps to brims, and keep the brims that are deep, abrupt and wide enough.

    Parameters
    ----------
    jumps : Jumps
    least_m : float
        Least fall of a brim, metres.
    shape : tuple of int
        Height and width of the image.
    parameters : BrimParameters

    Notes
    -----
    A brim as a whole has less noise than each of its pixels. Ripples and noise make the ground
    before a crest look level at some pixels, but seldom at most of them.
    """
    p = parameters
    jumps = jumps.among(jumps.fall_m - least_m > p.pixel_noises * jumps.noise_m)
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
    kept = mean(jumps.fall_m) - least_m > p.noises * mean(jumps.noise_m) / np.sqrt(samples)
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
