"""Ground meshes: at image resolution inside the view, coarse outside."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.simulation.landforms import Landforms, follow_steps
from rover_obstacle_detection.simulation.poses import CameraPose, HeightFunction
from rover_obstacle_detection.simulation.rigs import Rig

Floats = NDArray[np.float32]

_CELL_PX = 1.5
"""Size of a mesh cell in the image."""
_FINEST_M = 0.003
"""Smallest mesh cell. Finer relief is a bump map."""
_FARTHEST_M = 420.0
_SIDE_GROWTH, _SIDE_COLUMNS = 1.17, 33
"""Columns outside the view widen by this factor, to cast shadows and light into it."""
_VIEW_MARGIN = 1.3
"""Width of the fine columns relative to the view, to include the right camera's view."""
_LONGEST_CELL = 6.0
"""Longest cell relative to its width. Far ground is foreshortened, so its cells are long."""
_STEPS_REACH_M = 40.0
"""Steps farther away need no finer cells."""
_COARSE_CELL_M = 0.15
_COARSE_REACH_M = 30.0
_COARSE_OVERLAP_M = 0.3
_COARSE_DEPTH_M = 0.03
"""The coarse mesh lies this much below the ground, so it is never visible."""


@dataclass(frozen=True)
class GroundMesh:
    """A grid of quadrilaterals, split into triangles.

    Parameters
    ----------
    vertices : ndarray of float32, shape (rows, columns, 3)
        World coordinates, metres. Rows increase away from the rover, columns to its left.
    """

    vertices: Floats

    @property
    def faces(self) -> NDArray[np.uint32]:
        """Triangles facing upward, shape (f, 3)."""
        rows, columns = self.vertices.shape[:2]
        index = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
        a, b = index[:-1, :-1].ravel(), index[1:, :-1].ravel()
        c, d = index[1:, 1:].ravel(), index[:-1, 1:].ravel()
        return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])

    @property
    def texture_coordinates(self) -> Floats:
        """Coordinates of the vertices in a texture that covers the grid, shape (n, 2)."""
        rows, columns = self.vertices.shape[:2]
        u = (np.arange(columns, dtype=np.float32) + 0.5) / columns
        v = (np.arange(rows, dtype=np.float32) + 0.5) / rows
        grid = np.stack(np.broadcast_arrays(u[np.newaxis], v[:, np.newaxis]), 2)
        return grid.reshape(-1, 2).astype(np.float32)

    @property
    def normals(self) -> Floats:
        """Upward unit normals of the vertices, shape (n, 3)."""
        down_rows = np.gradient(self.vertices, axis=0)
        along_columns = np.gradient(self.vertices, axis=1)
        normal = np.cross(down_rows, along_columns)
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        return normal.reshape(-1, 3).astype(np.float32)


@dataclass(frozen=True)
class Fan:
    """A grid of ground positions whose cells appear about equally large in the image.

    Seen from above, its columns diverge like the view and its rows get farther apart.

    Parameters
    ----------
    x_m, y_m : ndarray of float32, shape (rows, columns)
    cell_m : ndarray of float32, shape (rows,)
        Width of the cells inside the view.
    """

    x_m: Floats
    y_m: Floats
    cell_m: Floats

    def refined(self, factor: int) -> Fan:
        """Return the texel centres, with `factor` x `factor` texels per cell."""
        rows, columns = self.x_m.shape
        row = (np.arange(rows * factor) + 0.5) / factor - 0.5
        column = (np.arange(columns * factor) + 0.5) / factor - 0.5
        cell = np.interp(row, np.arange(rows), self.cell_m) / factor
        return Fan(
            _resampled(self.x_m, row, column),
            _resampled(self.y_m, row, column),
            cell.astype(np.float32),
        )


def fan(
    rig: Rig, camera: StereoCamera, pose: CameraPose, landforms: Landforms | None = None
) -> Fan:
    """Lay out the grid for a view of level ground, with margin for relief and both cameras.

    With `landforms`, the grid is also fine on the faces of steps and on lower ground beyond.
    """
    pitch, height_m = math.radians(rig.pitch_deg), rig.camera_height_m
    half_view = math.atan((camera.height - 1) / 2 / camera.fy)
    steepest = min(pitch + half_view + math.radians(10), math.radians(88))
    nearest = height_m / math.tan(steepest) - 0.1
    # The columns meet where the image plane cuts the ground, behind the camera.
    nearest = max(nearest, -0.8 * height_m * math.tan(pitch))
    above_m = _height_above(rig, camera, pose, landforms)
    ahead = _row_distances(nearest, pitch, above_m, camera.fx)
    above = np.array([above_m(distance) for distance in ahead])
    depth = ahead * math.cos(pitch) + above * math.sin(pitch)
    half = _VIEW_MARGIN * camera.width / 2 / camera.fx
    inner = np.linspace(-half, half, 2 * math.ceil(half * camera.fx / _CELL_PX) + 1)
    growth = (inner[1] - inner[0]) * np.cumsum(_SIDE_GROWTH ** np.arange(1, _SIDE_COLUMNS + 1))
    tangent = np.concatenate([-(half + growth)[::-1], inner, half + growth])
    left = tangent[np.newaxis] * depth[:, np.newaxis]
    cell_m = (inner[1] - inner[0]) * depth
    places = Fan(*_to_world(ahead, left, pose), cell_m.astype(np.float32))
    if landforms is None or not landforms.has_steps:
        return places
    return Fan(*follow_steps(places.x_m, places.y_m, places.cell_m, landforms))


def _height_above(
    rig: Rig, camera: StereoCamera, pose: CameraPose, landforms: Landforms | None
) -> Callable[[float], float]:
    """Return the camera's height above the lowest ground in view, by distance ahead."""
    if landforms is None or not landforms.has_steps:
        return lambda ahead_m: rig.camera_height_m
    ahead = np.arange(-2.0, _STEPS_REACH_M, 0.1)
    aside = _VIEW_MARGIN * camera.width / 2 / camera.fx * np.linspace(-1, 1, 41)
    left = aside * np.maximum(ahead, 0.5)[:, np.newaxis]
    lowest = np.minimum(landforms.step_height(*_to_world(ahead, left, pose)).min(1), 0)
    # A sudden change would shear the cells.
    reach = np.ones(11) / 11
    lowest = np.convolve(np.pad(lowest, 5, mode='edge'), reach, 'valid')
    return lambda ahead_m: rig.camera_height_m - float(np.interp(ahead_m, ahead, lowest))


def _row_distances(
    nearest_m: float, pitch_rad: float, above_m: Callable[[float], float], focal_px: float
) -> NDArray[np.float64]:
    rows = [nearest_m]
    while rows[-1] < _FARTHEST_M:
        height_m = above_m(rows[-1])
        depth = rows[-1] * math.cos(pitch_rad) + height_m * math.sin(pitch_rad)
        cell = max(_CELL_PX * depth / focal_px, _FINEST_M)
        elongation = rows[-1] / (7 * height_m)
        rows.append(rows[-1] + cell * min(max(1.0, elongation), _LONGEST_CELL))
    return np.array(rows)


def fan_mesh(places: Fan, height: HeightFunction) -> GroundMesh:
    """Return the mesh of a fan on the ground."""
    z = height(places.x_m, places.y_m)
    return GroundMesh(np.stack([places.x_m, places.y_m, z], 2))


def surrounding_mesh(pose: CameraPose, height: HeightFunction, near_edge_m: float) -> GroundMesh:
    """Return coarse ground around the rover, which casts shadows and light into the view.

    It ends just beyond the near edge of the fan, `near_edge_m` ahead of the rover.
    """
    ahead = np.arange(-_COARSE_REACH_M, near_edge_m + _COARSE_OVERLAP_M, _COARSE_CELL_M)
    left = np.arange(-_COARSE_REACH_M, _COARSE_REACH_M, _COARSE_CELL_M)
    x, y = _to_world(ahead, left, pose)
    return GroundMesh(np.stack([x, y, height(x, y) - np.float32(_COARSE_DEPTH_M)], 2))


def _to_world(
    ahead: NDArray[np.float64], left: NDArray[np.float64], pose: CameraPose
) -> tuple[Floats, Floats]:
    """Convert positions relative to the rover to x, y; `left` may vary along both axes."""
    cosine, sine = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    x0, y0 = pose.ground_below
    x = x0 + ahead[:, np.newaxis] * cosine - left * sine
    y = y0 + ahead[:, np.newaxis] * sine + left * cosine
    return x.astype(np.float32), y.astype(np.float32)


def _resampled(grid: Floats, row: NDArray[np.float64], column: NDArray[np.float64]) -> Floats:
    """Interpolate a grid bilinearly; extrapolate linearly outside."""
    rows, columns = grid.shape
    i = np.clip(np.floor(row).astype(int), 0, rows - 2)
    j = np.clip(np.floor(column).astype(int), 0, columns - 2)
    s = (row - i).astype(np.float32)[:, np.newaxis]
    t = (column - j).astype(np.float32)[np.newaxis]
    lines = grid[i] * (1 - s) + grid[i + 1] * s
    return np.asarray(lines[:, j] * (1 - t) + lines[:, j + 1] * t, np.float32)
