"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -4.7474,
        'log_excess': 0.0,
        'log_pixels': 0.4303,
        'measured_share': 0.0,
        'agreement': 0.0,
        'log_contrast': 0.3874,
        'log_raggedness': -0.9452,
        'log_disparity_noise': -2.0184,
        'rock_log_odds': 0.5938,
        'ground_log_pixels': 0.0,
        'ground_log_noise': 0.0,
        'height_share': 0.1491,
        'slope_share': -0.4781,
        'drop_share': 0.4016,
        'region_share': -1.0463,
        'grey_level_share': -0.0916,
        'roughness_step_share': 0.0,
    },
    'study': {
        'intercept': -4.4642,
        'log_excess': 0.2365,
        'log_pixels': 0.0,
        'measured_share': 1.9928,
        'agreement': 0.0,
        'log_contrast': 0.1788,
        'log_raggedness': 0.0,
        'log_disparity_noise': 0.0,
        'rock_log_odds': 0.0,
        'ground_log_pixels': 0.0,
        'ground_log_noise': 0.0,
        'height_share': 0.0,
        'slope_share': 0.0,
        'drop_share': 0.0,
        'region_share': 0.0,
        'grey_level_share': 3.5112,
        'roughness_step_share': 0.0235,
    },
}
