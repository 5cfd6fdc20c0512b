"""The parts of the image that stand up from the ground."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.components import top_heights
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.terrain.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Standing:
    """The parts of the image that stand up from the ground.

    Parameters
    ----------
    parts : ndarray of int32, shape (height, width)
        Part of each pixel, 1 and up; 0 is the ground.
    top_m : ndarray of float32, shape (parts + 1,)
        Height of each part, metres.
    """

    parts: NDArray[np.int32]
    top_m: NDArray[np.float32]


def standing_parts(terrain: Terrain, parameters: RockParameters) -> Standing:
    """Find what rises from the ground by a good part of the rover's step or more.

    Parameters
    ----------
    terrain : Terrain
    parameters : RockParameters

    Notes
    -----
    Hysteresis thresholding (Canny 1986): connected pixels above the foot level, some of which rise
    well above the noise.
    """
    p = parameters
    height_m = np.nan_to_num(terrain.height_m, nan=0.0)
    noise_m = terrain.noise_m
    smooth_m = cv2.blur(height_m, (3, 3))
    foot = height_m > np.maximum(p.min_standing_m, p.foot_noises * noise_m)
    core_m = np.maximum(p.candidate_share * p.max_step_m, p.candidate_noises * noise_m)
    core = foot & (smooth_m > core_m)
    count, labels = cv2.connectedComponents(foot.astype(np.uint8), connectivity=8)
    kept = np.bincount(labels[core], minlength=count) >= p.min_core_pixels
    kept[0] = False
    parts = np.where(kept[labels], labels, 0).astype(np.int32)
    return Standing(parts, top_heights(np.asarray(smooth_m, np.float32), parts, p.top_share))
