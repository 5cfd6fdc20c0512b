"""Rise and height of the ground at the scale of a rover, with their noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from rover_obstacle_detection.detection.terrain.elevation_map import Grid
from rover_obstacle_detection.detection.terrain.local_regression import (
    LocalPlanes,
    gaussian_sum,
    local_planes,
)
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.terrain import Layer


@dataclass(frozen=True, eq=False)
class Rise:
    """Rise of the ground over the plane, metres per metre.

    Parameters
    ----------
    right, forward : ndarray of float32, shape of the map
    noise : ndarray of float32, shape of the map
        Standard deviation in the direction in which the rise is known least.
    scale_m : ndarray of float32, shape of the map
        Standard deviation of the Gaussian over which the rise is measured, metres.
    cell_m : float
        Side of a cell, metres.
    """

    right: Grid
    forward: Grid
    noise: Grid
    scale_m: Grid
    cell_m: float


def ground_rise(layer: Layer, parameters: TerrainParameters) -> Rise:
    """Measure the rise at rover scale, and more widely where noise would look like a slope.

    Parameters
    ----------
    layer : Layer
    parameters : TerrainParameters

    Notes
    -----
    Cells weigh by the inverse of their noise. By the inverse of its square, which would suit noise
    alone, the face of a ledge, which has many pixels, would tilt the ground around it.

    With these weights w, the rise has the standard deviation ``sqrt(m n) / (2 s sum(w))`` for n
    cells with spread s, where m pixels share their noise. The narrowest scale at which the rise is
    known well enough counts, with a smooth transition to the next. No scale is narrower than a
    cell.
    """
    first = math.tan(math.radians(parameters.narrowest_rise_noise_deg))
    tolerated = math.tan(math.radians(parameters.tolerated_rise_noise_deg))
    cell_m = layer.positions.cell_m
    trust = np.sqrt(layer.information) * layer.is_bare
    scales = sorted({max(scale_m / cell_m, 1.0) for scale_m in parameters.scales_of_rise_m})
    narrow = _rise_at(layer.mean_m, trust, scales[0], cell_m, parameters)
    right, forward, noise, scale_m = narrow.right, narrow.forward, narrow.noise, narrow.scale_m
    share = np.clip(noise / first - 1, 0, 1)
    for scale in scales[1:]:
        if not (share[layer.seen] > 0).any():
            break
        wide = _rise_at(layer.mean_m, trust, scale, cell_m, parameters)
        # In a strip a few cells wide, the coarser grid of a wide scale can be noisier.
        share = share * (wide.noise < noise)
        right = right + share * (wide.right - right)
        forward = forward + share * (wide.forward - forward)
        noise = noise + share * (wide.noise - noise)
        scale_m = scale_m + share * (wide.scale_m - scale_m)
        share = share * np.clip(wide.noise / tolerated - 1, 0, 1)
    return Rise(right, forward, noise, scale_m, cell_m)


def _rise_at(
    mean_m: Grid, trust: Grid, sigma_cells: float, cell_m: float, parameters: TerrainParameters
) -> Rise:
    planes = local_planes(mean_m, trust, sigma_cells, parameters.rise_ridge, parameters)
    cells = gaussian_sum((trust > 0).astype(np.float32), sigma_cells, parameters)
    return Rise(
        planes.rise_along_columns / np.float32(cell_m),
        planes.rise_along_rows / np.float32(cell_m),
        _rise_noise(planes, cells, cell_m, parameters.shared_pixels),
        np.full_like(mean_m, sigma_cells * cell_m),
        cell_m,
    )


def _rise_noise(planes: LocalPlanes, cells: Grid, cell_m: float, shared_pixels: float) -> Grid:
    known = 2 * np.float32(cell_m) * planes.spread * planes.weight
    known /= np.sqrt(np.maximum(cells * np.float32(shared_pixels), np.float32(1e-6)))
    return np.asarray(1 / np.maximum(known, np.float32(1e-3)), np.float32)


def ground_height(layer: Layer, parameters: TerrainParameters) -> tuple[Grid, Grid]:
    """Return the height of the ground over the plane at rover scale, and its noise.

    Parameters
    ----------
    layer : Layer
    parameters : TerrainParameters

    Returns
    -------
    height_m, noise_m : ndarray of float32, shape of the map
        Metres. The noise is that of a mean over everything seen around the cell, rocks included,
        since the ground under a rock is that beside it.
    """
    cell_m = layer.positions.cell_m
    own_m = max(parameters.smoothing_m, parameters.smoothing_cells * cell_m)
    least_m = parameters.min_scale_cells * cell_m
    sigma = max(parameters.drop_scale_m**2 - own_m**2, least_m**2) ** 0.5 / cell_m
    # Fading to zero beyond the map would make a hollow of its edge.
    height_m = cv2.GaussianBlur(layer.ground_m, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
    own = max(parameters.drop_scale_m / cell_m, 1.0)
    around, noise = (
        cv2.GaussianBlur(grid, (0, 0), own, borderType=cv2.BORDER_CONSTANT)
        for grid in (layer.information, layer.information * layer.noise_m)
    )
    samples = around * np.float32(2 * 2 * math.pi * own**2 / parameters.shared_pixels)
    mean_noise_m = 1 / np.sqrt(np.maximum(samples, 1e-5))
    common_m = parameters.common_noise_share * noise / np.maximum(around, 1e-5)
    return np.asarray(height_m, np.float32), np.asarray(
        np.hypot(mean_noise_m, common_m), np.float32
    )
