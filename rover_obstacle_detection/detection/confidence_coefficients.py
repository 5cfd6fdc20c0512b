"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -6.0033,
        'log_excess': 0.0,
        'log_pixels': 0.5389,
        'measured_share': 0.0,
        'agreement': 1.2681,
        'log_contrast': 0.9503,
        'log_raggedness': -1.8858,
        'log_disparity_noise': -2.2488,
        'rock_log_odds': 0.0,
        'ground_log_pixels': 0.0,
        'ground_log_noise': 0.0,
        'height_share': 1.8424,
        'slope_share': -1.56,
        'drop_share': -1.6315,
        'region_share': -3.4461,
        'grey_level_share': -0.8497,
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
