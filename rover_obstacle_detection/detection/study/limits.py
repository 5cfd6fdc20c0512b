"""Limits of roughness and elevation step (study, section 4.2 step 6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.study.parameters import StudyParameters


def exceeds_terrain_limits(
    roughness: NDArray[np.float32],
    step: NDArray[np.float32],
    disparity: NDArray[np.float32],
    elevation_m: NDArray[np.float32],
    parameters: StudyParameters,
) -> NDArray[np.bool_]:
    """Compare each window with T2 and T3, both widened by the effect of noise.

    Parameters
    ----------
    roughness, step : ndarray of float32, shape (height, width)
        Metres; NaN where unknown.
    disparity : ndarray of float32, shape (height, width)
        Pixels; 0 where there is no match.
    elevation_m : ndarray of float32, shape (height, width)
        Elevation relative to the left camera, metres.
    parameters : StudyParameters

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    A relative disparity error ``s = sigma_d / d`` moves a point by the same share along its ray,
    and so changes its elevation E by ``|E| s``.
    """
    with np.errstate(divide='ignore', invalid='ignore'):
        noise_m = np.abs(elevation_m) * np.float32(parameters.window_noise_px) / disparity
        max_roughness = np.hypot(
            parameters.max_roughness_m, parameters.noise_roughness_factor * noise_m
        )
        max_step = np.hypot(parameters.max_step_m, parameters.noise_step_factor * noise_m)
        return np.asarray((roughness > max_roughness) | (step > max_step))
