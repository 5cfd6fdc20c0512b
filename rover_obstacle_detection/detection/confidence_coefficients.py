"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -4.1112,
        'log_excess': 0.0,
        'log_pixels': 0.0492,
        'measured_share': 0.0,
        'agreement': 0.4906,
        'log_contrast': 0.182,
        'log_raggedness': -0.4763,
        'log_disparity_noise': -1.1043,
        'rock_log_odds': 1.33,
        'ground_log_pixels': 0.0541,
        'ground_log_noise': -1.1895,
        'height_share': 1.1075,
        'slope_share': -1.3348,
        'drop_share': 0.0737,
        'region_share': -1.0976,
        'grey_level_share': 1.8147,
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
