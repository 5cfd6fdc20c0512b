"""Confidence that an obstacle is one: a logistic model of its evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.result.confidence_coefficients import COEFFICIENTS
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.evidence import ObstacleEvidence
from rover_obstacle_detection.detection.result.parameters import ResultParameters

FEATURES = (
    'intercept',
    'log_excess',
    'log_pixels',
    'measured_share',
    'agreement',
    'log_contrast',
    'log_raggedness',
    'log_disparity_noise',
    'rock_log_odds',
    'ground_log_pixels',
    'ground_log_noise',
    *(f'{cue.name.lower()}_share' for cue in Cue if cue.name),
)
"""Names of the columns of `ObstacleEvidence.features`."""

STRENGTHEN = (
    'log_excess',
    'log_pixels',
    'measured_share',
    'agreement',
    'log_contrast',
    'rock_log_odds',
    'ground_log_pixels',
)
"""Confidence must not decrease with these."""

WEAKEN = ('log_raggedness', 'log_disparity_noise', 'ground_log_noise')
"""Confidence must not increase with these."""


def confidence(evidence: ObstacleEvidence, parameters: ResultParameters) -> NDArray[np.float32]:
    """Confidence in obstacles, given their evidence.

    Parameters
    ----------
    evidence : ObstacleEvidence
        Of n obstacles.
    parameters : ResultParameters

    Returns
    -------
    ndarray of float32, shape (n,)
        0 to 1: the share of such obstacles that were real in labelled scenes.
    """
    # A cue that is newer than the fit has no weight.
    weights = np.array([COEFFICIENTS[parameters.method].get(name, 0.0) for name in FEATURES])
    return np.asarray(logistic(evidence.features() @ weights), np.float32)


def logistic(log_odds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert log odds to probabilities."""
    return np.asarray(0.5 * (1 + np.tanh(0.5 * log_odds)))
