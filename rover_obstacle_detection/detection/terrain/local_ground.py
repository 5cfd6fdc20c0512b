"""The ground that a rock stands on: smooth at the scale of the rover, without the rocks."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.terrain.local_regression import LocalPlanes, local_planes
from rover_obstacle_detection.detection.terrain.viewpoint import Sight

Grid = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LocalGround:
    """The ground under and between the obstacles.

    Parameters
    ----------
    height_m : ndarray of float32, shape (rows, columns)
        Height of the ground over the plane, metres, everywhere: empty cells take the trend of
        those around them.
    trust : ndarray of float32, shape (rows, columns)
        Trust in the cells that show the ground; 0 in the others.
    trend : LocalPlanes
        Of the ground around each cell.
    """

    height_m: Grid
    trust: Grid
    trend: LocalPlanes


def local_ground(
    height_m: Grid,
    weight: Grid,
    cell_m: float,
    *,
    opening_m: float,
    trend_m: float,
    smoothing_m: float,
    tolerance_m: float,
    sight: Sight,
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
    opening_m : float
        Obstacles narrower than this are opened away, metres.
    trend_m : float
        Standard deviation of the local linear regression, metres.
    smoothing_m : float
        Standard deviation of the final mean, metres.
    tolerance_m : float
        Cells within so much of the trend are ground, metres.
    sight : Sight
        Tells the noise, one standard deviation of which is tolerated as well.

    Returns
    -------
    LocalGround

    Notes
    -----
    Grey-value opening gives the lower envelope, a local linear regression its trend (local
    constants would flatten slopes towards the edge of what is seen), and the mean of the cells
    near the trend the ground; the last two are done twice, the second time from the ground itself.
    For the noise the first trend is that of all cells, rocks as well.
    """
    present = weight > 0
    filled = _follow(height_m, weight, np.zeros_like(height_m), 1.0)
    ground = _opened(filled, present, max(3, round(opening_m / cell_m) | 1))
    tolerated_m = tolerance_m
    trend = local_planes(height_m, weight, trend_m / cell_m)
    for _ in range(2):
        with_noise_m = np.hypot(np.float32(tolerated_m), sight.noise_m(trend))
        near = _without_feet(present & (height_m - ground < with_noise_m), present)
        trusted = np.where(near, weight, 0).astype(np.float32)
        trend = local_planes(height_m, trusted, trend_m / cell_m)
        ground = _follow(height_m, trusted, trend.height, smoothing_m / cell_m)
        tolerated_m = tolerance_m * 0.6
    return LocalGround(ground, trusted, trend)


def _without_feet(near: NDArray[np.bool_], present: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Leave out the cells that touch what stands on the ground: a rock's foot is no ground."""
    standing = (present & ~near).astype(np.uint8)
    return np.asarray(near & (cv2.dilate(standing, np.ones((3, 3), np.uint8)) == 0))


def _opened(height_m: Grid, present: NDArray[np.bool_], size: int) -> Grid:
    # A square takes two passes over the map, a disc one for each of its cells.
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (size, size))
    far = np.float32(1e6)
    lowest = cv2.erode(np.where(present, height_m, far), kernel, borderType=cv2.BORDER_REPLICATE)
    # Behind a rock nothing is seen: a place there would know the rock alone, and call it ground.
    lowest = np.where(present, lowest, -far)
    return np.asarray(cv2.dilate(lowest, kernel, borderType=cv2.BORDER_REPLICATE), np.float32)


def smoothed(image: Grid, sigma_cells: float) -> Grid:
    """Gaussian sum of what is on the map; nothing lies outside of it."""
    return np.asarray(
        cv2.GaussianBlur(image, (0, 0), sigma_cells, borderType=cv2.BORDER_CONSTANT), np.float32
    )


def _follow(height_m: Grid, weight: Grid, trend: Grid, sigma_cells: float) -> Grid:
    """Weighted mean of the deviation from the trend, fading to the trend where weight is thin."""
    deviation = smoothed(weight * (height_m - trend), sigma_cells)
    total = smoothed(weight, sigma_cells)
    floor = np.float32(1e-3) * np.float32(max(float(weight.mean()), 1e-9))
    return trend + deviation / (total + floor)
