"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -3.0,
        'log_excess': 1.0,
        'log_pixels': 0.3,
        'measured_share': 0.5,
        'agreement': 0.5,
        'log_contrast': 0.5,
        'log_raggedness': -0.5,
        'log_disparity_noise': -0.5,
        'height_share': 0.5,
        'slope_share': 0.5,
        'drop_share': 0.5,
        'region_share': 0.0,
        'grey_level_share': 0.0,
        'roughness_step_share': 0.0,
    },
    'study': {
        'intercept': -3.0,
        'log_excess': 1.0,
        'log_pixels': 0.3,
        'measured_share': 0.5,
        'agreement': 0.5,
        'log_contrast': 0.5,
        'log_raggedness': -0.5,
        'log_disparity_noise': -0.5,
        'height_share': 0.0,
        'slope_share': 0.0,
        'drop_share': 0.0,
        'region_share': 0.0,
        'grey_level_share': 0.0,
        'roughness_step_share': 0.0,
    },
}
