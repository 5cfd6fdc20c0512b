"""Pixel labels from scene geometry: free, rock, slope, drop, not counted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation.description import TruthParameters
from rover_obstacle_detection.simulation.poses import HeightFunction

Floats = NDArray[np.float32]
Labels = NDArray[np.uint8]

FREE, ROCK, SLOPE, DROP, NOT_COUNTED = 0, 1, 2, 3, 255

AMBIGUOUS = 0.20
"""Rocks whose height is within this fraction of the clearance are not counted."""

_CELL_M = 0.05
_SMOOTHING_M = 0.10
"""Standard deviation of the low-pass that defines rover scale."""
_SURROUNDINGS_M = 2.0
"""Diameter of the disc for drops. Hollows wider than this are not drops."""
_MARGIN_M = 2.3
"""Keeps the border effects of both filters outside the area of interest."""


@dataclass(frozen=True)
class LocalGround:
    """The ground at rover scale, on a grid aligned with the world axes.

    Parameters
    ----------
    x0_m, y0_m : float
        Centre of the first cell.
    cell_m : float
    height_m : ndarray of float32, shape (rows, columns)
        Relief low-passed with a standard deviation of 0.10 m. Rows are along y.
    slope_deg : ndarray of float32, shape (rows, columns)
    drop_m : ndarray of float32, shape (rows, columns)
        Depth below the surroundings: closing with a disc of 2 m minus height.
    """

    x0_m: float
    y0_m: float
    cell_m: float
    height_m: Floats
    slope_deg: Floats
    drop_m: Floats

    def read(self, grid: Floats, x_m: NDArray[np.floating], y_m: NDArray[np.floating]) -> Floats:
        """Interpolate one of the grids bilinearly at positions of any shape."""
        rows, columns = grid.shape
        column = np.clip((np.asarray(x_m) - self.x0_m) / self.cell_m, 0, columns - 1.001)
        row = np.clip((np.asarray(y_m) - self.y0_m) / self.cell_m, 0, rows - 1.001)
        j, i = column.astype(int), row.astype(int)
        t, s = column - j, row - i
        value = (grid[i, j] * (1 - t) + grid[i, j + 1] * t) * (1 - s) + (
            grid[i + 1, j] * (1 - t) + grid[i + 1, j + 1] * t
        ) * s
        return np.asarray(value, np.float32)


def local_ground(
    height: HeightFunction, low: Sequence[float], high: Sequence[float]
) -> LocalGround:
    """Sample and survey the ground of a rectangle of the world.

    Parameters
    ----------
    height : callable
        Returns the height (m) at positions x, y.
    low, high : sequence of float
        Corners x, y. A margin is added.
    """
    x0, y0 = low[0] - _MARGIN_M, low[1] - _MARGIN_M
    columns = math.ceil((high[0] + _MARGIN_M - x0) / _CELL_M) + 1
    rows = math.ceil((high[1] + _MARGIN_M - y0) / _CELL_M) + 1
    x = (x0 + _CELL_M * np.arange(columns)).astype(np.float32)
    y = (y0 + _CELL_M * np.arange(rows)).astype(np.float32)
    relief = height(*(grid.astype(np.float32) for grid in np.meshgrid(x, y)))
    return survey(relief, x0, y0, _CELL_M)


def survey(relief: Floats, x0_m: float, y0_m: float, cell_m: float) -> LocalGround:
    """Low-pass a height grid and compute slope and drops."""
    smooth = cv2.GaussianBlur(
        relief, (0, 0), _SMOOTHING_M / cell_m, borderType=cv2.BORDER_REPLICATE
    )
    along_y, along_x = np.gradient(smooth, cell_m)
    slope = np.degrees(np.arctan(np.hypot(along_x, along_y)))
    size = round(_SURROUNDINGS_M / cell_m) | 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    closed = cv2.morphologyEx(smooth, cv2.MORPH_CLOSE, disc, borderType=cv2.BORDER_REPLICATE)
    return LocalGround(
        x0_m,
        y0_m,
        cell_m,
        np.asarray(smooth, np.float32),
        slope.astype(np.float32),
        np.asarray(closed - smooth, np.float32),
    )


def label(
    points: NDArray[np.floating],
    depth_m: Floats,
    instances: NDArray[np.uint16],
    rock_height_m: NDArray[np.floating],
    ground: LocalGround,
    truth: TruthParameters,
) -> Labels:
    """Label the pixels of the left image.

    Parameters
    ----------
    points : ndarray, shape (height, width, 3)
        World coordinates of each pixel's surface; ignored where there is none.
    depth_m : ndarray of float32, shape (height, width)
        NaN where there is no surface.
    instances : ndarray of uint16, shape (height, width)
        Rock number; 0 for ground.
    rock_height_m : ndarray, shape (n + 1,)
        Height of each rock above the local ground, by instance number.
    ground : LocalGround
    truth : TruthParameters

    Returns
    -------
    ndarray of uint8, shape (height, width)
        0 free, 1 rock, 2 slope, 3 drop, 255 not counted.
    """
    with np.errstate(invalid='ignore'):
        counted = depth_m <= truth.range_m
    labels = np.full(depth_m.shape, NOT_COUNTED, np.uint8)
    x, y, z = points[counted].T
    steep = ground.read(ground.slope_deg, x, y) > truth.slope_limit_deg
    low = ground.read(ground.drop_m, x, y) > truth.drop_m
    labels[counted] = np.where(steep, SLOPE, np.where(low, DROP, FREE))
    above = np.zeros(depth_m.shape, np.float32)
    above[counted] = z - ground.read(ground.height_m, x, y)
    kind = _instance_labels(above, counted, instances, rock_height_m, truth.clearance_m)
    on_rock = counted & (kind[instances] != FREE)
    labels[on_rock] = kind[instances][on_rock]
    return labels


def _instance_labels(
    above_m: Floats,
    counted: NDArray[np.bool_],
    instances: NDArray[np.uint16],
    rock_height_m: NDArray[np.floating],
    clearance_m: float,
) -> Labels:
    """Return `ROCK`, `NOT_COUNTED`, or `FREE` (labelled as the ground) by instance number."""
    kind = np.full(len(rock_height_m), FREE, np.uint8)
    kind[rock_height_m > (1 - AMBIGUOUS) * clearance_m] = NOT_COUNTED
    kind[rock_height_m > (1 + AMBIGUOUS) * clearance_m] = ROCK
    kind[0] = FREE
    visible_m = np.zeros(len(rock_height_m), np.float32)
    np.maximum.at(visible_m, instances[counted], above_m[counted])
    edge = np.concatenate([instances[0], instances[-1], instances[:, 0], instances[:, -1]])
    cut = np.zeros(len(rock_height_m), bool)
    cut[edge] = True
    # The visible part of a rock cut off by the image border must itself be an obstacle.
    kind[cut & (kind == ROCK) & (visible_m <= (1 + AMBIGUOUS) * clearance_m)] = NOT_COUNTED
    return kind
