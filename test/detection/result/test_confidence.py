from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.config import METHODS
from rover_obstacle_detection.detection.result.confidence import (
    FEATURES,
    STRENGTHEN,
    WEAKEN,
    confidence,
    logistic,
)
from rover_obstacle_detection.detection.result.confidence_coefficients import COEFFICIENTS
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.evidence import ObstacleEvidence
from rover_obstacle_detection.detection.result.parameters import ResultParameters

METHOD = [ResultParameters(method=method) for method in METHODS]
HYBRID = ResultParameters(method='hybrid')

each_method = pytest.mark.parametrize('parameters', METHOD, ids=METHODS)


def evidence(pixels=(100, 10), **changes):
    """Obstacles by height, with 3D, of some pixels."""
    pixels = np.array(pixels, np.float64)
    one, zero = np.ones_like(pixels), np.zeros_like(pixels)
    given = {
        'excess': 5 * one,
        'pixels': pixels,
        'measured_share': one,
        'agreement': zero,
        'contrast': one,
        'raggedness': 3.6 * one,
        'rock_log_odds': zero,
        'ground_share': zero,
        'noise_share': 0.2 * one,
        'cue_shares': np.column_stack([one if cue is Cue.HEIGHT else zero for cue in Cue]),
        'disparity_noise_px': 0.1,
        'min_noise_share': 0.05,
    }
    return ObstacleEvidence(**{**given, **changes})


@each_method
def test_every_feature_has_a_coefficient(parameters):
    assert set(COEFFICIENTS[parameters.method]) == set(FEATURES)
    assert evidence().features().shape == (2, len(FEATURES))


@each_method
def test_confidence_is_a_probability(parameters):
    found = confidence(evidence(), parameters)
    assert found.dtype == np.float32
    assert ((found > 0) & (found < 1)).all()


@each_method
def test_without_obstacles_there_is_no_confidence(parameters):
    assert confidence(evidence(()), parameters).shape == (0,)


@each_method
def test_evidence_for_an_obstacle_never_lowers_confidence(parameters):
    coefficients = COEFFICIENTS[parameters.method]
    assert all(coefficients[name] >= 0 for name in STRENGTHEN)
    assert all(coefficients[name] <= 0 for name in WEAKEN)


def test_confidence_is_the_logistic_function_of_the_weighted_features(monkeypatch):
    monkeypatch.setitem(COEFFICIENTS, 'hybrid', dict.fromkeys(FEATURES, 0.0))
    assert confidence(evidence(), HYBRID).tolist() == [0.5, 0.5]
    weights = dict.fromkeys(FEATURES, 0.0) | {'intercept': -1.0, 'log_pixels': 0.5}
    monkeypatch.setitem(COEFFICIENTS, 'hybrid', weights)
    odds = np.exp(-1) * np.sqrt([100, 10])
    assert confidence(evidence(), HYBRID) == pytest.approx(odds / (1 + odds), rel=1e-5)


@pytest.mark.parametrize(
    ('name', 'more'),
    [
        ('agreement', np.array([0.5, 0.5])),
        ('contrast', np.array([4.0, 4.0])),
        ('rock_log_odds', np.array([2.0, 2.0])),
    ],
)
def test_hybrid_is_more_confident_with_more_evidence(name, more):
    before, after = confidence(evidence(), HYBRID), confidence(evidence(**{name: more}), HYBRID)
    assert (after > before).all()


def test_hybrid_is_more_confident_of_larger_obstacles_and_cleaner_pairs():
    large, small = confidence(evidence(), HYBRID)
    assert large > small
    assert (confidence(evidence(disparity_noise_px=0.3), HYBRID) < (large, small)).all()


def test_logistic_function_does_not_overflow():
    assert logistic(np.array([-1000.0, 0.0, 1000.0])).tolist() == [0, 0.5, 1]


def test_a_feature_that_is_newer_than_the_fit_has_no_weight(monkeypatch):
    module = 'rover_obstacle_detection.detection.result.confidence.COEFFICIENTS'
    monkeypatch.setattr(module, {'hybrid': {'intercept': 1.0}})
    np.testing.assert_allclose(confidence(evidence(), HYBRID), logistic(np.ones(2)), rtol=1e-6)
