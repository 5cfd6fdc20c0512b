"""The ground that rocks stand on: smooth at the scale of the rover, without the rocks."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.terrain.local_regression import LocalPlanes, local_planes
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.viewpoint import Viewpoint

Grid = NDArray[np.float32]

_FAR_M = np.float32(1e6)


@dataclass(frozen=True, eq=False)
class LocalGround:
    """The ground under and between the obstacles.

    Parameters
    ----------
    height_m : ndarray of float32, shape (rows, columns)
        Over the plane, metres. Empty cells continue the trend of those around them.
    trust : ndarray of float32, shape (rows, columns)
        Trust in the cells that show ground; 0 in all others.
    trend : LocalPlanes
        Of the ground around each cell.
    is_bare : ndarray of bool, shape (rows, columns)
        Cells with nothing on them that is narrower than the opening, and no part of a wall. Faces
        of ledges and trenches are bare, although they are far from the trend.
    """

    height_m: Grid
    trust: Grid
    trend: LocalPlanes
    is_bare: NDArray[np.bool_]


def local_ground(
    height_m: Grid,
    weight: Grid,
    cell_m: float,
    viewpoint: Viewpoint,
    parameters: TerrainParameters,
) -> LocalGround:
    """Estimate the ground under and between the obstacles.

    Parameters
    ----------
    height_m : ndarray of float32, shape (rows, columns)
        Mean height of each cell over the ground plane, metres.
    weight : ndarray of float32, shape (rows, columns)
        Trust in each cell; 0 where it is empty.
    cell_m : float
        Side of a cell, metres.
    viewpoint : Viewpoint
        Gives the height noise; one standard deviation of it is tolerated as well.
    parameters : TerrainParameters

    Notes
    -----
    1. A grey-value opening gives the lower envelope.
    2. A local linear regression of the cells near it gives the trend. Local constants would
       flatten slopes towards the edge of the visible ground.
    3. The mean of the cells near the trend is the ground.
    4. Bare is what hardly rises above anything as wide as the opening, and less than a wall above
       the ground. Heights are smoothed before that opening, as noise would lower it: a ledge with
       a sharp edge, higher than 0.10 m, loses its last cell by that.

    Steps 2 and 3 run twice, the second time from the ground itself. The first noise estimate uses
    the trend of all cells, rocks included.
    """
    p = parameters
    present = weight > 0
    # What is an obstacle for a rover with a high step is wide, too.
    wide_m = max(cell_m, p.cell_per_step * p.max_step_m)
    trend_cells = max(p.trend_m, p.trend_cells * wide_m) / cell_m
    smoothing_cells = max(p.smoothing_m, p.smoothing_cells * wide_m) / cell_m
    opening_cells = max(p.opening_m, p.opening_cells * wide_m) / cell_m
    filled = _follow(height_m, weight, np.zeros_like(height_m), 1.0)
    size = round(opening_cells) | 1
    # A square kernel takes two passes over the map, a disc one for each of its cells.
    ground = _opened(filled, present, cv2.getStructuringElement(cv2.MORPH_RECT, (size, size)))
    tolerance_m = p.ground_share * p.resolved_m
    tolerated_m = tolerance_m
    trend = local_planes(height_m, weight, trend_cells, p.trend_ridge, p)
    for _ in range(2):
        noise_m = viewpoint.noise_m(trend)
        with_noise_m = np.sqrt(np.float32(tolerated_m**2) + noise_m * noise_m)
        near = _without_feet(present & (height_m - ground < with_noise_m), present)
        trusted = np.where(near, weight, 0).astype(np.float32)
        trend = local_planes(height_m, trusted, trend_cells, p.trend_ridge, p)
        ground = _follow(height_m, trusted, trend.height, smoothing_cells)
        tolerated_m = tolerance_m * p.second_ground_share
    tolerated = np.hypot(np.float32(tolerance_m), viewpoint.noise_m(trend))
    is_bare = present & (height_m - _wide_terrain(filled, present, size, p) < tolerated)
    is_bare &= height_m - ground < p.wall_share * p.resolved_m
    return LocalGround(ground, trusted, trend, _without_feet(is_bare, present))


def smoothed(image: Grid, sigma_cells: float) -> Grid:
    """Gaussian mean with zeros outside the map."""
    return np.asarray(
        cv2.GaussianBlur(image, (0, 0), sigma_cells, borderType=cv2.BORDER_CONSTANT), np.float32
    )


def _without_feet(near: NDArray[np.bool_], present: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Remove the cells that touch what stands on the ground: a rock's foot is not ground."""
    standing = (present & ~near).astype(np.uint8)
    return np.asarray(near & (cv2.dilate(standing, np.ones((3, 3), np.uint8)) == 0))


def _wide_terrain(
    height_m: Grid, present: NDArray[np.bool_], size: int, parameters: TerrainParameters
) -> Grid:
    """Height of what is as wide as the opening, with its outline.

    A square is wider along its diagonals: it would remove turned plates that are up to 1.4 times
    as wide, and cut more off an outline. A disc cuts only corners and small bumps. Geodesic
    dilation, the step of reconstruction (Vincent 1993), regrows them by a few cells. Repeated
    until nothing changes, it would also climb the rocks that touch a ledge.
    """
    # Small discs one after the other make a large one, in less time.
    times = max(1, round(size / parameters.disc_cells))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size // 2 // times * 2 + 1,) * 2)
    terrain_m = _opened(height_m, present, kernel, times)
    for _ in range(parameters.regrown_cells):
        terrain_m[~present] = -_FAR_M
        terrain_m = np.minimum(cv2.dilate(terrain_m, np.ones((3, 3), np.uint8)), height_m)
    return terrain_m


def _opened(
    height_m: Grid, present: NDArray[np.bool_], kernel: cv2.typing.MatLike, times: int = 1
) -> Grid:
    lowest = cv2.erode(
        np.where(present, height_m, _FAR_M),
        kernel,
        iterations=times,
        borderType=cv2.BORDER_REPLICATE,
    )
    # Empty cells behind a rock are near nothing but the rock: the envelope must not rise to it.
    lowest = np.where(present, lowest, -_FAR_M)
    opened = cv2.dilate(lowest, kernel, iterations=times, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(opened, np.float32)


def _follow(height_m: Grid, weight: Grid, trend: Grid, sigma_cells: float) -> Grid:
    """Weighted mean of the deviation from the trend, fading to the trend where weight is thin."""
    deviation = smoothed(weight * (height_m - trend), sigma_cells)
    total = smoothed(weight, sigma_cells)
    floor = np.float32(1e-3) * np.float32(max(float(weight.mean()), 1e-9))
    return trend + deviation / (total + floor)
