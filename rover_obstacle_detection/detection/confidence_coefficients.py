"""Coefficients of the confidence, by detection method.

Written by ``scripts/calibrate_confidence.py``, which fits them to labelled scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

COEFFICIENTS: Mapping[str, Mapping[str, float]] = {
    'hybrid': {
        'intercept': -4.1513,
        'log_excess': 0.143,
        'log_pixels': 0.521,
        'measured_share': 0.0403,
        'agreement': 0.0,
        'log_contrast': 0.8323,
        'log_raggedness': -1.7546,
        'log_disparity_noise': -1.2362,
        'height_share': 0.4225,
        'slope_share': 0.3643,
        'drop_share': -3.0789,
        'region_share': -1.7741,
        'grey_level_share': -3.8124,
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
