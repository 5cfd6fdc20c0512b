"""The terrain from above: height over the ground plane in square cells."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane

Grid = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class MapPositions:
    """Where each pixel lies on the map, in cells, as ``cv2.remap`` takes it.

    Parameters
    ----------
    column, row : ndarray of float32, shape (height, width)
        Cells to the right and forward; far outside where there is no 3D.
    shape : tuple of int
        Rows and columns of the map.
    cell_m : float
        Side of a cell, metres.
    first_column, first_row : int
        Cells from the point below the left camera to the map's first cell.
    """

    column: NDArray[np.float32]
    row: NDArray[np.float32]
    shape: tuple[int, int]
    cell_m: float
    first_column: int = 0
    first_row: int = 0

    def within(self, rows: slice) -> MapPositions:
        """Return the positions of some of the image rows."""
        return replace(self, column=self.column[rows], row=self.row[rows])

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Pixels that lie on the map."""
        return self.row > -5


def ground_axes(ground: GroundPlane) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return unit vectors within the plane: to the right, and forward along the optical axis."""
    normal = np.asarray(ground.normal)
    right = np.array([1.0, 0.0, 0.0])
    right -= normal * (right @ normal)
    right /= np.linalg.norm(right)
    return right, np.cross(normal, right)


def plane_coordinates(
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    ground: GroundPlane,
    rays: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Distance of each point to the right and forward of the camera, along the plane.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    camera : StereoCamera
    ground : GroundPlane
    rays : tuple of two ndarray of float32, optional
        ``x / z`` and ``y / z`` of each disparity, shapes that broadcast to theirs. By default,
        those of a whole image.

    Returns
    -------
    across_m, along_m : ndarray of float32, shape (height, width)
        Metres; 0 where there is no match.
    """
    x_over_z, y_over_z = camera.rays() if rays is None else rays
    with np.errstate(divide='ignore'):
        depth_m = np.float32(camera.fx * camera.baseline_m) / disparity
    depth_m[disparity <= 0] = 0
    across, along = (
        np.float32(axis[0]) * x_over_z + (np.float32(axis[1]) * y_over_z + np.float32(axis[2]))
        for axis in ground_axes(ground)
    )
    across *= depth_m
    along *= depth_m
    return across, along


def map_positions(
    across_m: NDArray[np.float32],
    along_m: NDArray[np.float32],
    usable: NDArray[np.bool_],
    cell_m: float,
) -> MapPositions:
    """Place every usable pixel on a map that is just large enough.

    Parameters
    ----------
    across_m, along_m : ndarray of float32, shape (height, width)
        From `plane_coordinates`.
    usable : ndarray of bool, shape (height, width)
    cell_m : float
        Side of a cell.
    """
    if not usable.any():
        outside = np.full_like(across_m, -10)
        return MapPositions(outside, outside, (1, 1), cell_m)
    across, along = across_m / np.float32(cell_m), along_m / np.float32(cell_m)
    first_column, last_column = _extent(across, usable)
    first_row, last_row = _extent(along, usable)
    unusable = ~usable
    for cells, first in ((across, first_column), (along, first_row)):
        cells -= first
        cells[unusable] = -10
    return MapPositions(
        across,
        along,
        (last_row - first_row + 1, last_column - first_column + 1),
        cell_m,
        first_column,
        first_row,
    )


def cell_means(
    values: NDArray[np.float32], weights: NDArray[np.float32], positions: MapPositions
) -> tuple[Grid, Grid]:
    """Average the pixels in each cell by weight.

    Returns
    -------
    mean : ndarray of float32, shape of the map
        0 in empty cells.
    weight : ndarray of float32, shape of the map
        Sum of weights; 0 in empty cells.
    """
    return CellSums(weights > 0, positions).means(values, weights)


class CellSums:
    """Sums over the pixels in each cell.

    Parameters
    ----------
    inside : ndarray of bool, shape (height, width)
        Pixels that count. They must lie on the map.
    positions : MapPositions
    """

    def __init__(self, inside: NDArray[np.bool_], positions: MapPositions) -> None:
        self._shape = rows, columns = positions.shape
        cell = (positions.row + np.float32(0.5)).astype(np.int32)
        cell *= columns
        cell += (positions.column + np.float32(0.5)).astype(np.int32)
        # Pixels that do not count share one more cell, which is faster than to select the others.
        cell[~inside] = rows * columns
        # Counting converts any other type of index, each time.
        self._cell = cell.ravel().astype(np.intp)

    def means(
        self, values: NDArray[np.float32], weights: NDArray[np.float32]
    ) -> tuple[Grid, Grid]:
        """Weighted mean of each cell, 0 in empty cells, and its sum of weights."""
        total = self._sum(weights)
        # Pixels that do not count may have a weight of 0 and an infinite value.
        with np.errstate(invalid='ignore'):
            mean = self._sum(weights * values) / np.maximum(total, 1e-12)
        return mean.astype(np.float32), total.astype(np.float32)

    def _sum(self, values: NDArray[np.float32]) -> NDArray[np.float64]:
        size = self._shape[0] * self._shape[1]
        total = np.bincount(self._cell, weights=values.ravel(), minlength=size + 1)[:size]
        return np.asarray(total.reshape(self._shape), np.float64)


def sample_map(grid: Grid, positions: MapPositions) -> NDArray[np.float32]:
    """Sample the map at each pixel, bilinearly."""
    return np.asarray(
        cv2.remap(
            grid, positions.column, positions.row, cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        np.float32,
    )  # fmt: skip


def _extent(cells: NDArray[np.float32], usable: NDArray[np.bool_]) -> tuple[int, int]:
    first, last, _, _ = cv2.minMaxLoc(cells, usable.view(np.uint8))
    return math.floor(first), math.ceil(last) + 1
