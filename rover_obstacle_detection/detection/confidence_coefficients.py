"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -4.7224,
        'log_excess': 0.0,
        'log_pixels': 0.4408,
        'measured_share': 0.0,
        'agreement': 0.0,
        'log_contrast': 0.4129,
        'log_raggedness': -0.9953,
        'log_disparity_noise': -1.9961,
        'rock_log_odds': 0.5844,
        'ground_log_pixels': 0.0,
        'ground_log_noise': 0.0,
        'height_share': 0.185,
        'slope_share': -0.434,
        'drop_share': 0.4446,
        'region_share': -1.2828,
        'grey_level_share': -0.114,
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
