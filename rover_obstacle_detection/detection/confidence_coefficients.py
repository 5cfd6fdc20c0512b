"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -7.2525,
        'log_excess': 0.1013,
        'log_pixels': 0.4767,
        'measured_share': 0.0,
        'agreement': 2.7173,
        'log_contrast': 0.6783,
        'log_raggedness': -1.3862,
        'log_disparity_noise': -2.5731,
        'height_share': 0.8664,
        'slope_share': -0.2781,
        'drop_share': -2.7223,
        'region_share': -4.5703,
        'grey_level_share': -4.609,
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
        'height_share': 0.0,
        'slope_share': 0.0,
        'drop_share': 0.0,
        'region_share': 0.0,
        'grey_level_share': 3.5112,
        'roughness_step_share': 0.0235,
    },
}
