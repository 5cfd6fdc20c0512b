"""The ground as triangles: as fine as the image where it looks, coarse elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.simulation.poses import CameraPose
from rover_obstacle_detection.simulation.rigs import Rig

Floats = NDArray[np.float32]
HeightFunction = Callable[[Floats, Floats], Floats]

_CELL_PX = 1.5
_FINEST_M = 0.003
_FARTHEST_M = 420.0
_COARSE_CELL_M = 0.15
_COARSE_REACH_M = 30.0


@dataclass(frozen=True)
class GroundMesh:
    """A grid of quadrilaterals.

    Parameters
    ----------
    vertices : ndarray of float32, shape (rows, columns, 3)
        In the world, metres. Rows go away from the rover, columns from right to left.
    """

    vertices: Floats

    @property
    def faces(self) -> NDArray[np.uint32]:
        """Triangles, shape (f, 3), with their front upward."""
        rows, columns = self.vertices.shape[:2]
        index = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
        a, b = index[:-1, :-1].ravel(), index[1:, :-1].ravel()
        c, d = index[1:, 1:].ravel(), index[:-1, 1:].ravel()
        return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])

    @property
    def texture_coordinates(self) -> Floats:
        """Place of each vertex in a texture of the grid's own rows and columns, (n, 2)."""
        rows, columns = self.vertices.shape[:2]
        u = (np.arange(columns, dtype=np.float32) + 0.5) / columns
        v = (np.arange(rows, dtype=np.float32) + 0.5) / rows
        grid = np.stack(np.broadcast_arrays(u[np.newaxis], v[:, np.newaxis]), 2)
        return grid.reshape(-1, 2).astype(np.float32)

    @property
    def normals(self) -> Floats:
        """Unit normals of the vertices, upward, shape (n, 3)."""
        down_rows = np.gradient(self.vertices, axis=0)
        along_columns = np.gradient(self.vertices, axis=1)
        normal = np.cross(down_rows, along_columns)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        return normal.reshape(-1, 3).astype(np.float32)


@dataclass(frozen=True)
class Fan:
    """A grid of places on the ground that the image sees as about equal cells.

    Seen from above its columns diverge as the camera's do; its rows get farther apart.

    Parameters
    ----------
    x_m, y_m : ndarray of float32, shape (rows, columns)
    cell_m : ndarray of float32, shape (rows,)
        Width of a cell of the inner columns.
    """

    x_m: Floats
    y_m: Floats
    cell_m: Floats

    def refined(self, factor: int) -> Fan:
        """Return the centres of the texels when each cell is split in ``factor`` squared."""
        rows, columns = self.x_m.shape
        row = (np.arange(rows * factor) + 0.5) / factor - 0.5
        column = (np.arange(columns * factor) + 0.5) / factor - 0.5
        cell = np.interp(row, np.arange(rows), self.cell_m) / factor
        return Fan(
            _resampled(self.x_m, row, column),
            _resampled(self.y_m, row, column),
            cell.astype(np.float32),
        )


def fan(rig: Rig, camera: StereoCamera, pose: CameraPose) -> Fan:
    """Lay the grid for a view over level ground, with margin for both eyes and for relief."""
    pitch, eye_m = math.radians(rig.pitch_deg), rig.camera_height_m
    half_view = math.atan((camera.height - 1) / 2 / camera.fy)
    steepest = min(pitch + half_view + math.radians(10), math.radians(88))
    nearest = eye_m / math.tan(steepest) - 0.1
    # Behind the point under the camera's tilted image plane the columns would cross.
    nearest = max(nearest, -0.8 * eye_m * math.tan(pitch))
    ahead = _row_distances(nearest, pitch, eye_m, camera.fx)
    depth = ahead * math.cos(pitch) + eye_m * math.sin(pitch)
    half = 1.3 * camera.width / 2 / camera.fx
    inner = np.linspace(-half, half, 2 * math.ceil(half * camera.fx / _CELL_PX) + 1)
    growth = (inner[1] - inner[0]) * np.cumsum(1.17 ** np.arange(1, 34))
    tangent = np.concatenate([-(half + growth)[::-1], inner, half + growth])
    left = tangent[np.newaxis] * depth[:, np.newaxis]
    cosine, sine = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    x0, y0 = pose.ground_below
    x = x0 + ahead[:, np.newaxis] * cosine - left * sine
    y = y0 + ahead[:, np.newaxis] * sine + left * cosine
    cell_m = (inner[1] - inner[0]) * depth
    return Fan(x.astype(np.float32), y.astype(np.float32), cell_m.astype(np.float32))


def _row_distances(
    nearest_m: float, pitch_rad: float, eye_m: float, focal_px: float
) -> NDArray[np.float64]:
    rows = [nearest_m]
    while rows[-1] < _FARTHEST_M:
        depth = rows[-1] * math.cos(pitch_rad) + eye_m * math.sin(pitch_rad)
        cell = max(_CELL_PX * depth / focal_px, _FINEST_M)
        # Far ground is seen at a grazing angle: a pixel is much longer than wide there.
        rows.append(rows[-1] + cell * min(max(1.0, rows[-1] / (7 * eye_m)), 6.0))
    return np.array(rows)


def fan_mesh(places: Fan, height: HeightFunction) -> GroundMesh:
    """Lift a fan to the ground."""
    z = height(places.x_m, places.y_m)
    return GroundMesh(np.stack([places.x_m, places.y_m, z], 2))


def surrounding_mesh(pose: CameraPose, height: HeightFunction, behind_m: float) -> GroundMesh:
    """Coarse ground behind and beside the rover: it throws shadows and light into the view.

    It reaches a little under the fan, ``behind_m`` ahead of the rover, and lies a little lower,
    so that it never shows.
    """
    ahead = np.arange(-_COARSE_REACH_M, behind_m + 0.3, _COARSE_CELL_M)
    left = np.arange(-_COARSE_REACH_M, _COARSE_REACH_M, _COARSE_CELL_M)
    cosine, sine = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    x0, y0 = pose.ground_below
    x = (x0 + ahead[:, np.newaxis] * cosine - left * sine).astype(np.float32)
    y = (y0 + ahead[:, np.newaxis] * sine + left * cosine).astype(np.float32)
    return GroundMesh(np.stack([x, y, height(x, y) - np.float32(0.03)], 2))


def _resampled(grid: Floats, row: NDArray[np.float64], column: NDArray[np.float64]) -> Floats:
    """Read a grid bilinearly, and beyond its outer points straight on."""
    rows, columns = grid.shape
    i = np.clip(np.floor(row).astype(int), 0, rows - 2)
    j = np.clip(np.floor(column).astype(int), 0, columns - 2)
    s = (row - i).astype(np.float32)[:, np.newaxis]
    t = (column - j).astype(np.float32)[np.newaxis]
    lines = grid[i] * (1 - s) + grid[i + 1] * s
    return np.asarray(lines[:, j] * (1 - t) + lines[:, j + 1] * t, np.float32)
