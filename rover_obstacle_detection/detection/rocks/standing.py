"""The parts of the image that stand up from the ground."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.components import components, top_heights
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
    height_m = np.where(terrain.measured, terrain.height_m, np.float32(0))
    noise_m = terrain.noise_m
    smooth_m = np.asarray(cv2.blur(height_m, (3, 3)), np.float32)
    foot = height_m > np.maximum(p.min_standing_m, p.foot_noises * noise_m)
    pixels, owner, count = components(foot)
    core_m = p.candidate_noises * noise_m.ravel()[pixels]
    core = smooth_m.ravel()[pixels] > np.maximum(p.candidate_share * p.max_step_m, core_m)
    kept = (np.bincount(owner[core], minlength=count) >= p.min_core_pixels)[owner]
    parts = np.zeros(foot.shape, np.int32)
    parts.ravel()[pixels[kept]] = owner[kept] + 1
    return Standing(parts, top_heights(smooth_m, parts, p.top_share))
