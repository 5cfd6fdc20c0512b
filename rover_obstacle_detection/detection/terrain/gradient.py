"""How the ground rises at the scale of a rover, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.noise import SHARED_PIXELS
from rover_obstacle_detection.detection.terrain.local_regression import LocalPlanes, local_planes
from rover_obstacle_detection.detection.terrain.survey import SMOOTHING_M, Layer

Grid = NDArray[np.float32]

# What a wheel feels, and up to a wheel base or so where noise leaves no choice.
SCALES_M = (0.14, 0.2, 0.3, 0.5)
RELIEF_M = 0.10
# Share of a pixel's noise that all around it have in common, as from the pull to whole pixels.
COMMON_SHARE = 0.5
# More noise than this would make slopes of 20 degrees out of passable ground too often.
TOLERATED_DEG = 3.0
# Against division by zero: a rise is biased by as much.
_RIDGE = 1e-3


@dataclass(frozen=True, eq=False)
class Rise:
    """Rise of the ground over the plane, in metres per metre.

    Parameters
    ----------
    right, forward : ndarray of float32, shape of the map
    noise : ndarray of float32, shape of the map
        Standard deviation in the direction in which it is known the least.
    """

    right: Grid
    forward: Grid
    noise: Grid


def ground_rise(layer: Layer) -> Rise:
    """Measure the rise at rover scale, and more widely where noise would look like a slope.

    Parameters
    ----------
    layer : Layer

    Returns
    -------
    Rise

    Notes
    -----
    The rise of a plane fitted with Gaussian weights has the standard deviation
    sigma / (2 s sqrt n) for n pixels of noise sigma spread by s; pixels in a window share their
    noise. The narrowest of the scales counts whose rise is known to 3 degrees, and a mixture of
    two in between. No scale is narrower than a cell.
    """
    tolerated = math.tan(math.radians(TOLERATED_DEG))
    cell_m = layer.positions.cell_m
    trust = layer.information * layer.is_ground
    scales = sorted({max(scale_m / cell_m, 1.0) for scale_m in SCALES_M})
    narrow = _rise_at(layer.mean_m, trust, scales[0], cell_m)
    right, forward, noise = narrow.right, narrow.forward, narrow.noise
    share = np.clip(noise / tolerated - 1, 0, 1)
    for scale in scales[1:]:
        if not (share[layer.seen] > 0).any():
            break
        wide = _rise_at(layer.mean_m, trust, scale, cell_m)
        # Of a strip a few cells wide, coarser grids know less than finer ones.
        share = share * (wide.noise < noise)
        right = right + share * (wide.right - right)
        forward = forward + share * (wide.forward - forward)
        noise = noise + share * (wide.noise - noise)
        share = share * np.clip(wide.noise / tolerated - 1, 0, 1)
    return Rise(right, forward, noise)


def _rise_at(mean_m: Grid, trust: Grid, sigma_cells: float, cell_m: float) -> Rise:
    planes = local_planes(mean_m, trust, sigma_cells, ridge=_RIDGE)
    return Rise(
        planes.rise_along_columns / np.float32(cell_m),
        planes.rise_along_rows / np.float32(cell_m),
        _rise_noise(planes, cell_m),
    )


def _rise_noise(planes: LocalPlanes, cell_m: float) -> Grid:
    known = 2 * np.float32(cell_m) * planes.spread * np.sqrt(planes.weight / SHARED_PIXELS)
    return np.asarray(1 / np.maximum(known, np.float32(1e-3)), np.float32)


def ground_height(layer: Layer) -> tuple[Grid, Grid]:
    """Give the height of the ground over the plane at rover scale, and how well it is known.

    Parameters
    ----------
    layer : Layer

    Returns
    -------
    height_m, noise_m : ndarray of float32, shape of the map
        Metres; the noise is that of a mean over all that was seen around, rocks as well: under
        them the ground is that beside them.
    """
    cell_m = layer.positions.cell_m
    own_m = max(SMOOTHING_M, 1.2 * cell_m)
    sigma = max(RELIEF_M**2 - own_m**2, (0.6 * cell_m) ** 2) ** 0.5 / cell_m
    # The map goes on as it ends: fading to zero would make a hollow of its edge.
    height_m = cv2.GaussianBlur(layer.ground_m, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
    own = max(RELIEF_M / cell_m, 1.0)
    around, noise = (
        cv2.GaussianBlur(grid, (0, 0), own, borderType=cv2.BORDER_CONSTANT)
        for grid in (layer.information, layer.information * layer.noise_m)
    )
    samples = around * np.float32(2 * 2 * math.pi * own**2 / SHARED_PIXELS)
    mean_noise_m = 1 / np.sqrt(np.maximum(samples, 1e-5))
    common_m = COMMON_SHARE * noise / np.maximum(around, 1e-5)
    return np.asarray(height_m, np.float32), np.asarray(
        np.hypot(mean_noise_m, common_m), np.float32
    )
