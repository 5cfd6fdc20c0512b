"""Pixels at which the ground is known to be level within a step."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.terrain import Terrain

Mask = NDArray[np.bool_]


def level_ground(terrain: Terrain, parameters: TerrainParameters) -> Mask:
    """Find the pixels that lie within a step of the local ground, as far as noise lets one tell.

    Noise must be so low that a step would show. What is measured to lie beyond a step, by more
    than noise, is never free, also where no cue makes it an obstacle.

    Parameters
    ----------
    terrain : Terrain
    parameters : TerrainParameters

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    p = parameters
    with np.errstate(invalid='ignore'):
        within = np.abs(terrain.height_m) < p.max_step_m + p.certain_noises * terrain.noise_m
    quiet = terrain.noise_m < p.max_noise_share * p.max_step_m
    return np.asarray(terrain.measured & within & quiet)


def uneven(terrain: Terrain, obstacles: Mask, parameters: TerrainParameters) -> Mask:
    """Find where heights vary so much within a few pixels that the ground is not known.

    A step may end there, or matching has lost the surface, as on the dark face of a trench.

    Parameters
    ----------
    terrain : Terrain
    obstacles : ndarray of bool, shape (height, width)
        Obstacles do not make the ground beside them uneven.
    parameters : TerrainParameters

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    p = parameters
    # Neighbours share their noise, so every second row and column shows as much.
    every = np.s_[::2, ::2]
    window = (2 * (p.relief_window_px // 4) + 1,) * 2
    counted = terrain.measured[every] & ~obstacles[every]
    height_m = np.where(counted, terrain.height_m[every], np.float32(0))
    count = cv2.boxFilter(counted.view(np.uint8), cv2.CV_32F, window, normalize=False)
    share = 1 / np.maximum(count, np.float32(1))
    mean_m = cv2.boxFilter(height_m, cv2.CV_32F, window, normalize=False) * share
    squares = cv2.sqrBoxFilter(height_m, cv2.CV_32F, window, normalize=False) * share
    relief_m = np.sqrt(np.maximum(squares - mean_m * mean_m, 0))
    limit_m = np.float32(p.max_relief_share * p.max_step_m)
    found = relief_m > limit_m + np.float32(p.relief_noises) * terrain.noise_m[every]
    size = obstacles.shape[::-1]
    return cv2.resize(found.view(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
