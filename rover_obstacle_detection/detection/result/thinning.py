"""Fewer points where many lie close together."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.elevation_map import ground_axes

# A map of more cells is not filled but sorted, which takes longer and less memory.
_MAX_CELLS = 4_000_000


def one_per_cell(
    points: NDArray[np.float32], ground: GroundPlane, cell_m: float
) -> NDArray[np.intp]:
    """Choose one point for each square cell of the ground.

    Parameters
    ----------
    points : ndarray of float32, shape (n, 3)
        In the left optical frame, metres; row by row of the image.
    ground : GroundPlane
    cell_m : float
        Side of a cell, metres.

    Returns
    -------
    ndarray of int, shape (m,)
        Indices of the chosen points, ascending: the last of each cell, which is nearest to the
        camera.
    """
    if not len(points):
        return np.zeros(0, np.intp)
    # Several times as fast as a matrix product with so few columns.
    column, row = (
        np.floor(cv2.transform(points[:, np.newaxis], (axis / cell_m)[np.newaxis])).ravel()
        for axis in ground_axes(ground)
    )
    column, row = column - column.min(), row - row.min()
    columns, rows = int(column.max()) + 1, int(row.max()) + 1
    cell = row.astype(np.intp) * columns + column.astype(np.intp)
    if columns * rows > _MAX_CELLS:
        _, from_end = np.unique(cell[::-1], return_index=True)
        return np.sort(len(cell) - 1 - from_end)
    last, index = np.empty(columns * rows, np.int32), np.arange(len(cell), dtype=np.int32)
    # Of points with the same cell, the last is kept.
    last[cell] = index
    return np.flatnonzero(last[cell] == index)
