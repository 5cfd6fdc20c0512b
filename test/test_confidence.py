from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.confidence import (
    FEATURES,
    confidence,
    logistic,
    measure_evidence,
)
from rover_obstacle_detection.detection.confidence_coefficients import COEFFICIENTS
from rover_obstacle_detection.detection.config import METHODS
from rover_obstacle_detection.detection.cue import Cue

SHAPE = (20, 30)
LARGE, SMALL = np.s_[2:12, 3:13], np.s_[15:17, 20:25]


def measure(**changes):
    """Two obstacles 2 m away, of 100 and 10 pixels, 0.06 m and 0.02 m above the step."""
    numbers = np.zeros(SHAPE, np.int32)
    numbers[LARGE], numbers[SMALL] = 1, 2
    height = np.zeros(SHAPE, np.float32)
    height[LARGE], height[SMALL] = 0.16, 0.12
    points = np.zeros((*SHAPE, 3), np.float32)
    points[..., 2] = 2
    given = {
        'points': points,
        'height_m': height,
        'noise_m': np.full(SHAPE, 0.02, np.float32),
        'cues': np.where(numbers, Cue.HEIGHT, 0).astype(np.uint8),
        'regions': numbers + 1,
        'max_step_m': 0.10,
        'window_px': 5,
        **changes,
    }
    return measure_evidence(numbers, **given)


def test_height_counts_in_noises_of_as_many_samples_as_are_independent():
    # 100 pixels are worth four of 5 x 5, ten are worth one.
    assert measure().excess == pytest.approx([3 * 2, 1], rel=1e-5)
    assert measure(window_px=1).excess == pytest.approx([3 * 10, 10**0.5], rel=1e-5)


def test_only_pixels_above_the_step_speak_for_height():
    height = np.full(SHAPE, 0.05, np.float32)
    height[2:7, 3:13] = 0.20
    excess = measure(height_m=height).excess
    assert excess == pytest.approx([5 * 2**0.5, 0], rel=1e-5)


def test_noise_is_that_of_the_pixels_above_the_step():
    noise = np.full(SHAPE, 0.5, np.float32)
    noise[LARGE] = 0.01
    assert measure(noise_m=noise).excess[0] == pytest.approx(12, rel=1e-5)


def test_sizes_and_ranges():
    points = np.zeros((*SHAPE, 3), np.float32)
    points[LARGE] = (0, 3, 4)
    points[SMALL] = np.nan
    evidence = measure(points=points)
    assert evidence.pixels.tolist() == [100, 10]
    assert evidence.range_m == pytest.approx([5, np.nan], nan_ok=True)
    assert evidence.measured_share.tolist() == [1, 0]


@pytest.mark.parametrize('name', ['points', 'height_m', 'noise_m'])
def test_a_pixel_is_measured_where_everything_is_known(name):
    array = np.full((*SHAPE, 3) if name == 'points' else SHAPE, 0.2, np.float32)
    array[2:6] = np.inf if name == 'noise_m' else np.nan
    evidence = measure(**{name: array})
    assert evidence.measured_share == pytest.approx([0.6, 1])
    assert np.isfinite(evidence.features()).all()


def test_shares_of_the_cues_and_where_they_agree():
    cues = np.zeros(SHAPE, np.uint8)
    cues[LARGE] = Cue.HEIGHT
    cues[2:4, 3:13] |= np.uint8(Cue.SLOPE)
    cues[15, 20:25] = Cue.REGION
    evidence = measure(cues=cues)
    shares = dict(zip(Cue, evidence.cue_shares.T, strict=True))
    assert shares[Cue.HEIGHT] == pytest.approx([1, 0])
    assert shares[Cue.SLOPE] == pytest.approx([0.2, 0])
    assert shares[Cue.REGION] == pytest.approx([0, 0.5])
    assert not shares[Cue.DROP].any()
    assert evidence.agreement == pytest.approx([0.2, 0])


def test_a_region_fits_where_most_of_it_is_obstacle():
    regions = np.ones(SHAPE, np.int32)
    regions[2:8, 3:13] = 2  # all obstacle
    regions[8:12, 3:20] = 3  # 40 of 68 pixels
    regions[15:20, 20:25] = 4  # 10 of 25
    assert measure(regions=regions).region_fit == pytest.approx([1, 0])
    regions[8:12, 3:30] = 3  # 40 of 108
    assert measure(regions=regions).region_fit == pytest.approx([0.6, 0])


def test_features_stand_in_the_order_of_their_names():
    features = dict(zip(FEATURES, measure().features().T, strict=True))
    assert len(features) == 7 + len(Cue)
    assert features['intercept'].tolist() == [1, 1]
    assert features['log_excess'] == pytest.approx(np.log([7, 2]), rel=1e-5)
    assert features['log_pixels'] == pytest.approx(np.log([100, 10]))
    assert features['log_range'] == pytest.approx(np.log([2, 2]))
    assert features['height_share'].tolist() == [1, 1]
    assert features['roughness_step_share'].tolist() == [0, 0]


def test_without_obstacles_there_is_nothing_to_be_sure_of():
    nothing = np.zeros(SHAPE, np.int32)
    evidence = measure_evidence(
        nothing,
        points=np.zeros((*SHAPE, 3), np.float32),
        height_m=np.zeros(SHAPE, np.float32),
        noise_m=np.ones(SHAPE, np.float32),
        cues=np.zeros(SHAPE, np.uint8),
        regions=np.ones(SHAPE, np.int32),
        max_step_m=0.1,
        window_px=5,
    )
    assert evidence.features().shape == (0, len(FEATURES))
    assert confidence(evidence, 'hybrid').shape == (0,)


@pytest.mark.parametrize('method', METHODS)
def test_every_method_has_a_coefficient_for_every_feature(method):
    assert set(COEFFICIENTS[method]) == set(FEATURES)
    sure = confidence(measure(), method)
    assert sure.dtype == np.float32
    assert ((sure > 0) & (sure < 1)).all()


def test_confidence_is_the_logistic_function_of_the_weighted_features(monkeypatch):
    monkeypatch.setitem(COEFFICIENTS, 'hybrid', dict.fromkeys(FEATURES, 0.0))
    assert confidence(measure(), 'hybrid').tolist() == [0.5, 0.5]
    weights = dict.fromkeys(FEATURES, 0.0) | {'intercept': -1.0, 'log_pixels': 0.5}
    monkeypatch.setitem(COEFFICIENTS, 'hybrid', weights)
    odds = np.exp(-1) * np.sqrt([100, 10])
    assert confidence(measure(), 'hybrid') == pytest.approx(odds / (1 + odds), rel=1e-5)


def test_the_hybrid_is_surer_of_what_is_higher_and_larger():
    large, small = confidence(measure(), 'hybrid')
    assert large > small
    low = np.full(SHAPE, 0.101, np.float32)
    assert confidence(measure(height_m=low), 'hybrid')[0] < large


def test_the_logistic_function_does_not_overflow():
    assert logistic(np.array([-1000.0, 0.0, 1000.0])).tolist() == [0, 0.5, 1]
