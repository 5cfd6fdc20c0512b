"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -5.0729,
        'log_excess': 0.0,
        'log_pixels': 0.4777,
        'measured_share': 0.0,
        'agreement': 1.1117,
        'log_contrast': 0.3322,
        'log_raggedness': -1.3589,
        'log_disparity_noise': -2.308,
        'rock_log_odds': 0.6117,
        'ground_log_pixels': 0.0,
        'ground_log_noise': 0.0,
        'height_share': 0.1638,
        'slope_share': -0.2961,
        'drop_share': 0.5237,
        'grey_level_share': 0.1824,
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
        'grey_level_share': 3.5112,
        'roughness_step_share': 0.0235,
    },
}
