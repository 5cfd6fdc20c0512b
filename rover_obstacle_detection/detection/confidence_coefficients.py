"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -4.1648,
        'log_excess': 0.0546,
        'log_pixels': 0.3908,
        'measured_share': 0.0,
        'agreement': 1.4465,
        'log_contrast': 0.4153,
        'log_raggedness': -1.1914,
        'log_disparity_noise': -1.5949,
        'rock_log_odds': 0.433,
        'ground_log_pixels': 0.0,
        'ground_log_noise': -1.1584,
        'height_share': 1.1312,
        'slope_share': -1.2883,
        'drop_share': -0.8588,
        'region_share': -2.7706,
        'grey_level_share': 0.8708,
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
