"""What the rover cannot drive over: what stands up, what is too steep, what drops away."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.images.components import top_heights
from rover_obstacle_detection.detection.terrain.elevation_map import cell_means, sample_map
from rover_obstacle_detection.detection.terrain.gradient import ground_height, ground_rise
from rover_obstacle_detection.detection.terrain.local_ground import smoothed
from rover_obstacle_detection.detection.terrain.slope import (
    dropped_cells,
    level_heights,
    steep_cells,
)
from rover_obstacle_detection.detection.terrain.survey import Terrain

# Rocks: what may be one, so that its outline is worth looking at.
FOOT_M = 0.02
FOOT_SHARE = 0.2
FOOT_NOISES = 1.0
STANDING_SHARE = 0.6
STANDING_NOISES = 2.5
MIN_CORE_PIXELS = 3
TOP_SHARE = 0.1

# Noise over so much of the step hides an obstacle.
KNOWN_SHARE = 0.5
# Slope and drop are of many pixels' mean: they stand more noise in each.
GROUND_KNOWN_SHARE = 1.5
DROP_SURROUNDINGS_M = 1.8
DROP_NOISES = 3.0
ROUGHNESS_M = 0.25


@dataclass(frozen=True, eq=False)
class Standing:
    """The parts of the image that stand up from the ground.

    Parameters
    ----------
    parts : ndarray of int32, shape (height, width)
        Number of each pixel's part; 0 is the ground.
    top_m : ndarray of float32, shape (parts + 1,)
        Height of each part, metres.
    """

    parts: NDArray[np.int32]
    top_m: NDArray[np.float32]


def standing_parts(terrain: Terrain, config: DetectorConfig) -> Standing:
    """Find what stands up from the ground, by a good part of the rover's step or more.

    Parameters
    ----------
    terrain : Terrain
    config : DetectorConfig

    Notes
    -----
    Hysteresis thresholding (Canny 1986): connected pixels over the foot level, where some rise
    well over the noise.
    """
    height_m = np.nan_to_num(terrain.height_m, nan=0.0)
    noise_m = terrain.noise_m
    smooth_m = cv2.blur(height_m, (3, 3))
    foot = height_m > np.maximum(min(FOOT_M, FOOT_SHARE * config.max_step), FOOT_NOISES * noise_m)
    core_m = np.maximum(STANDING_SHARE * config.max_step, STANDING_NOISES * noise_m)
    core = foot & (smooth_m > core_m)
    count, labels = cv2.connectedComponents(foot.astype(np.uint8), connectivity=8)
    kept = np.bincount(labels[core], minlength=count) >= MIN_CORE_PIXELS
    kept[0] = False
    parts = np.where(kept[labels], labels, 0).astype(np.int32)
    return Standing(parts, top_heights(np.asarray(smooth_m, np.float32), parts, TOP_SHARE))


def impassable_ground(
    terrain: Terrain, ground: GroundPlane, config: DetectorConfig
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find the pixels of ground that is too steep, and of ground that drops away.

    Parameters
    ----------
    terrain : Terrain
    ground : GroundPlane
        With the vertical against which slope counts.
    config : DetectorConfig
    """
    steep = np.zeros(terrain.height_m.shape, np.bool_)
    dropped = np.zeros_like(steep)
    for layer in terrain.layers:
        cell_m = layer.positions.cell_m
        in_steep = steep_cells(ground_rise(layer), ground, config.max_slope)
        height_m, noise_m = ground_height(layer)
        depth_m = config.max_step + DROP_NOISES * noise_m
        in_dropped = dropped_cells(
            level_heights(height_m, cell_m, ground),
            layer.seen,
            cell_m,
            DROP_SURROUNDINGS_M,
            depth_m,
        )
        for cells, image in ((in_steep, steep), (in_dropped, dropped)):
            if cells.any():
                inside = sample_map(cells.astype(np.float32), layer.positions) > 0.5
                image[layer.rows] |= inside & layer.pixels
    quiet = terrain.noise_m < GROUND_KNOWN_SHARE * config.max_step
    return steep & quiet, dropped & quiet


def rough_ground(
    terrain: Terrain, rocks: NDArray[np.bool_], config: DetectorConfig
) -> NDArray[np.bool_]:
    """Find the pixels of ground that is too rough: full of what is no obstacle by itself.

    Parameters
    ----------
    terrain : Terrain
    rocks : ndarray of bool, shape (height, width)
        What is an obstacle by itself does not make the ground around it rough.
    config : DetectorConfig

    Notes
    -----
    Roughness is the root mean square of the height above the local ground within about a wheel
    base, as in GESTALT and traversability maps; what noise alone would give is taken off.
    """
    rough = np.zeros_like(rocks)
    if not config.max_roughness:
        return rough
    usable = terrain.measured & ~rocks & (terrain.noise_m < KNOWN_SHARE * config.max_roughness)
    # A single false match is no rough ground, however high it seems to be.
    height_m = np.clip(terrain.height_m, -config.max_step, config.max_step)
    squares = np.where(usable, height_m**2 - terrain.noise_m**2, 0).astype(np.float32)
    for layer in terrain.layers:
        weight = (usable[layer.rows] & layer.pixels).astype(np.float32)
        mean, count = cell_means(squares[layer.rows], weight, layer.positions)
        present = (count > 0).astype(np.float32)
        sigma = max(ROUGHNESS_M / layer.positions.cell_m, 0.6)
        square = smoothed(mean * present, sigma) / np.maximum(smoothed(present, sigma), 1e-3)
        cells = square > config.max_roughness**2
        if cells.any():
            inside = sample_map(cells.astype(np.float32), layer.positions) > 0.5
            rough[layer.rows] |= inside & layer.pixels
    return rough & usable
