"""The ground from above, as a grid of free, obstacle and unknown cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane

FREE_CELL = np.int8(0)
OBSTACLE_CELL = np.int8(100)
UNKNOWN_CELL = np.int8(-1)

# Nearly a camera that looks straight down: its optical axis has no direction on the ground.
_MIN_FORWARD = 0.02
# A plane as steep as a wall has no point below the camera.
_MIN_COSINE = 0.1
# Whole numbers of cells stay whole in spite of rounding.
_ROUNDING = 1e-6
_LEVEL = GroundPlane(normal=(0.0, -1.0, 0.0), height_m=0.0, up=(0.0, -1.0, 0.0))


@dataclass(frozen=True, eq=False)
class ObstacleGrid:
    """Square cells of a level plane, at the ground below the left camera.

    Parameters
    ----------
    cells : ndarray of int8, shape (rows, columns)
        `FREE_CELL`, `OBSTACLE_CELL` or `UNKNOWN_CELL`. Columns go forward, rows to the left.
    cell_m : float
        Side of a cell, metres.
    origin_m : ndarray of float64, shape (3,)
        Outer corner of ``cells[0, 0]``, behind and to the right of all others, in the left optical
        frame.
    axes : ndarray of float64, shape (3, 3)
        Unit vectors forward, to the left and up, one a row, in the left optical frame. Forward is
        the optical axis along the plane; where it points straight down, the top of the image.
    """

    cells: NDArray[np.int8]
    cell_m: float
    origin_m: NDArray[np.float64]
    axes: NDArray[np.float64]


def obstacle_grid(
    obstacle_points: NDArray[np.float32],
    free_points: NDArray[np.float32],
    ground: GroundPlane,
    cell_m: float,
    extent_m: float,
) -> ObstacleGrid:
    """Sort points into cells.

    A cell with an obstacle point is an obstacle. Of the others, those with a free point are free.
    All others are unknown. Points outside the grid are left out.

    Parameters
    ----------
    obstacle_points, free_points : ndarray of float32, shape (n, 3)
        In the left optical frame, metres.
    ground : GroundPlane
    cell_m : float
        Side of a cell.
    extent_m : float
        Length of the grid ahead of the camera. It reaches half as far to either side.
    """
    up = np.asarray(ground.up, np.float64)
    forward = _forward(up)
    axes = np.stack((forward, np.cross(up, forward), up))
    columns = _cells(extent_m, cell_m)
    half = _cells(extent_m / 2, cell_m)
    below_m = ground.height_m / max(float(up @ np.asarray(ground.normal)), _MIN_COSINE)
    cells = np.full((2 * half, columns), UNKNOWN_CELL, np.int8)
    for points, value in ((free_points, FREE_CELL), (obstacle_points, OBSTACLE_CELL)):
        column, row = (np.floor(points @ (axis / cell_m).astype(np.float32)) for axis in axes[:2])
        row += half
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < 2 * half)
        cells[row[inside].astype(np.intp), column[inside].astype(np.intp)] = value
    return ObstacleGrid(cells, cell_m, -below_m * up - half * cell_m * axes[1], axes)


def unknown_grid(cell_m: float, extent_m: float, *, upside_down: bool = False) -> ObstacleGrid:
    """Make a grid of unknown cells, at the height of a level camera.

    Parameters
    ----------
    cell_m, extent_m : float
        See `obstacle_grid`.
    upside_down : bool
        Whether the camera is mounted upside down.
    """
    nothing = np.zeros((0, 3), np.float32)
    ground = _LEVEL.mirrored() if upside_down else _LEVEL
    return obstacle_grid(nothing, nothing, ground, cell_m, extent_m)


def mirrored_grid(grid: ObstacleGrid) -> ObstacleGrid:
    """Return a grid of images with their rows in reverse order as that of the images themselves.

    Left and right of the ground are exchanged, so the first row becomes the last.
    """
    mirror = np.array([1.0, -1.0, 1.0])
    across_m = len(grid.cells) * grid.cell_m * grid.axes[1]
    forward, left, up = grid.axes * mirror
    return ObstacleGrid(
        np.ascontiguousarray(grid.cells[::-1]),
        grid.cell_m,
        (grid.origin_m + across_m) * mirror,
        np.stack((forward, -left, up)),
    )


def _forward(up: NDArray[np.float64]) -> NDArray[np.float64]:
    along = np.array([0.0, 0.0, 1.0]) - up * up[2]
    if np.linalg.norm(along) < _MIN_FORWARD:
        along = np.array([0.0, -1.0, 0.0]) + up * up[1]
    return np.asarray(along / np.linalg.norm(along), np.float64)


def _cells(length_m: float, cell_m: float) -> int:
    return max(1, int(np.ceil(length_m / cell_m - _ROUNDING)))
