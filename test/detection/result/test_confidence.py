from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.config import METHODS
from rover_obstacle_detection.detection.result.confidence import (
    FEATURES,
    LEAST_NOISE_SHARE,
    STRENGTHEN,
    TYPICAL_NOISE_PX,
    WEAKEN,
    confidence,
    logistic,
    measure_evidence,
    seen_disparity_noise_px,
)
from rover_obstacle_detection.detection.result.confidence_coefficients import COEFFICIENTS
from rover_obstacle_detection.detection.result.cue import Cue

SHAPE = (20, 30)
LARGE, SMALL = np.s_[2:12, 3:13], np.s_[15:17, 20:25]


def measure(**changes):
    """Two obstacles of 100 and 10 pixels, 0.06 m and 0.02 m above the step; typical noise."""
    numbers = np.zeros(SHAPE, np.int32)
    numbers[LARGE], numbers[SMALL] = 1, 2
    height = np.zeros(SHAPE, np.float32)
    height[LARGE], height[SMALL] = 0.16, 0.12
    given = {
        'grey': np.full(SHAPE, 100, np.uint8),
        'disparity': np.full(SHAPE, 8, np.float32),
        'height_m': height,
        'noise_m': np.full(SHAPE, 0.02, np.float32),
        'rock_probability': np.full(SHAPE, np.nan, np.float32),
        'cues': np.where(numbers, Cue.HEIGHT, 0).astype(np.uint8),
        'max_step_m': 0.10,
        'window_px': 5,
        **changes,
    }
    given['noise_m'] = given['noise_m'] * as_typical(given['disparity'])
    return measure_evidence(numbers, **given)


def as_typical(disparity):
    return np.float32(TYPICAL_NOISE_PX / seen_disparity_noise_px(disparity))


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


def test_the_pair_that_shows_more_noise_makes_less_of_the_same_height():
    rng = np.random.default_rng(3)
    disparity = (20 + rng.normal(0, 0.4, SHAPE)).astype(np.float32)
    numbers = np.zeros(SHAPE, np.int32)
    numbers[LARGE] = 1
    given = {
        'grey': np.full(SHAPE, 100, np.uint8),
        'height_m': np.full(SHAPE, 0.16, np.float32),
        'noise_m': np.full(SHAPE, 0.02, np.float32),
        'rock_probability': np.full(SHAPE, np.nan, np.float32),
        'cues': np.zeros(SHAPE, np.uint8),
        'max_step_m': 0.1,
        'window_px': 5,
    }
    noisy = measure_evidence(numbers, disparity=disparity, **given)
    assert noisy.disparity_noise_px == pytest.approx(0.4, rel=0.15)
    assert noisy.excess == pytest.approx(3 * 2 * TYPICAL_NOISE_PX / noisy.disparity_noise_px)
    calm = measure_evidence(numbers, disparity=np.full(SHAPE, 20, np.float32), **given)
    assert calm.disparity_noise_px < 0.1 * noisy.disparity_noise_px
    assert calm.excess > 10 * noisy.excess


def test_disparity_noise_is_that_of_independent_noise_and_blind_to_slopes_and_jumps():
    rng = np.random.default_rng(1)
    ramp = np.tile(np.linspace(10, 60, 400), (300, 1))
    noisy = (ramp + rng.normal(0, 0.3, ramp.shape)).astype(np.float32)
    assert seen_disparity_noise_px(noisy) == pytest.approx(0.3, rel=0.05)
    assert seen_disparity_noise_px(ramp.astype(np.float32)) < 0.02
    noisy[:, 200:] += 500
    assert seen_disparity_noise_px(noisy) == pytest.approx(0.3, rel=0.15)


@pytest.mark.parametrize('shape', [(20, 30), (2, 3), (1, 1)])
def test_disparity_noise_is_typical_where_nothing_is_matched(shape):
    assert seen_disparity_noise_px(np.zeros(shape, np.float32)) == TYPICAL_NOISE_PX


def test_size_and_share_with_3d():
    height = np.full(SHAPE, 0.2, np.float32)
    height[2:6] = np.nan
    disparity = np.full(SHAPE, 8, np.float32)
    disparity[SMALL] = 0
    evidence = measure(height_m=height, disparity=disparity)
    assert evidence.pixels.tolist() == [100, 10]
    assert evidence.measured_share == pytest.approx([0.6, 0])
    assert evidence.excess[1] == 0
    assert np.isfinite(evidence.features()).all()


def test_pixels_without_a_known_noise_are_not_measured():
    noise = np.full(SHAPE, 0.02, np.float32)
    noise[LARGE] = np.inf
    evidence = measure(noise_m=noise)
    assert evidence.measured_share.tolist() == [0, 1]
    assert evidence.excess[0] == 0


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


def test_the_outline_filter_counts_where_height_or_looks_make_the_obstacle():
    probability = np.full(SHAPE, np.nan, np.float32)
    probability[2:7, 3:13] = 0.8
    cues = np.full(SHAPE, Cue.HEIGHT, np.uint8)
    cues[SMALL] = Cue.SLOPE
    probability[SMALL] = 0.8
    odds = measure(rock_probability=probability, cues=cues).rock_log_odds
    assert odds == pytest.approx([np.log(4) / 2, 0], rel=1e-5)
    probability[:] = 1
    odds = measure(rock_probability=probability, cues=cues).rock_log_odds
    assert odds[0] == pytest.approx(np.log(99), rel=1e-5)


def test_size_and_noise_of_what_is_too_steep_or_low_count_for_themselves():
    cues = np.full(SHAPE, Cue.SLOPE, np.uint8)
    cues[SMALL] = Cue.HEIGHT
    evidence = measure(cues=cues)
    assert evidence.ground_share.tolist() == [1, 0]
    features = dict(zip(FEATURES, evidence.features().T, strict=True))
    assert features['ground_log_pixels'] == pytest.approx([np.log(100), 0])
    noise_share = 0.02 * as_typical(np.full(SHAPE, 8, np.float32)) / 0.10
    assert features['ground_log_noise'] == pytest.approx(
        [np.log(noise_share + LEAST_NOISE_SHARE), 0], rel=1e-5
    )


def test_an_outline_on_an_edge_of_the_image_stands_out():
    grey = np.full(SHAPE, 100, np.uint8)
    assert measure(grey=grey).contrast == pytest.approx([1, 1])
    grey[LARGE] = 160
    large, small = measure(grey=grey).contrast
    assert large > 5
    assert small < 2


def test_the_more_outline_for_its_size_the_more_ragged():
    numbers = np.zeros(SHAPE, np.int32)
    numbers[2:12, 3:13] = 1  # 36 of 100 pixels
    numbers[15, 2:27] = 2  # a line
    numbers[18, 5] = 3  # a dot
    numbers[0:2, 20:30] = 4  # at the border, of 20 pixels 11 beside the ground
    floats = ('disparity', 'height_m', 'noise_m', 'rock_probability')
    given = {name: np.ones(SHAPE, np.float32) for name in floats}
    bytes_ = {name: np.zeros(SHAPE, np.uint8) for name in ('grey', 'cues')}
    evidence = measure_evidence(numbers, **given, **bytes_, max_step_m=0.1, window_px=5)
    assert evidence.raggedness == pytest.approx([3.6, 5, 1, 11 / 20**0.5])


def test_features_stand_in_the_order_of_their_names():
    features = dict(zip(FEATURES, measure().features().T, strict=True))
    assert len(features) == 11 + len(Cue)
    assert features['intercept'].tolist() == [1, 1]
    assert features['log_excess'] == pytest.approx(np.log([7, 2]), rel=1e-5)
    assert features['log_pixels'] == pytest.approx(np.log([100, 10]))
    assert features['log_contrast'] == pytest.approx([0, 0])
    assert features['log_raggedness'] == pytest.approx(np.log([3.6, 1.0 * 10**0.5]))
    noise_px = seen_disparity_noise_px(np.full(SHAPE, 8, np.float32))
    assert features['log_disparity_noise'] == pytest.approx(np.log([noise_px] * 2))
    assert features['rock_log_odds'].tolist() == [0, 0]
    assert features['ground_log_pixels'].tolist() == [0, 0]
    assert features['height_share'].tolist() == [1, 1]
    assert features['roughness_step_share'].tolist() == [0, 0]


def test_without_obstacles_there_is_nothing_to_be_sure_of():
    nothing = np.zeros(SHAPE, np.int32)
    evidence = measure_evidence(
        nothing,
        grey=np.zeros(SHAPE, np.uint8),
        disparity=np.zeros(SHAPE, np.float32),
        height_m=np.zeros(SHAPE, np.float32),
        noise_m=np.ones(SHAPE, np.float32),
        rock_probability=np.ones(SHAPE, np.float32),
        cues=np.zeros(SHAPE, np.uint8),
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


@pytest.mark.parametrize('method', METHODS)
def test_what_speaks_for_an_obstacle_never_speaks_against_it(method):
    assert all(COEFFICIENTS[method][name] >= 0 for name in STRENGTHEN)
    assert all(COEFFICIENTS[method][name] <= 0 for name in WEAKEN)


def test_confidence_is_the_logistic_function_of_the_weighted_features(monkeypatch):
    monkeypatch.setitem(COEFFICIENTS, 'hybrid', dict.fromkeys(FEATURES, 0.0))
    assert confidence(measure(), 'hybrid').tolist() == [0.5, 0.5]
    weights = dict.fromkeys(FEATURES, 0.0) | {'intercept': -1.0, 'log_pixels': 0.5}
    monkeypatch.setitem(COEFFICIENTS, 'hybrid', weights)
    odds = np.exp(-1) * np.sqrt([100, 10])
    assert confidence(measure(), 'hybrid') == pytest.approx(odds / (1 + odds), rel=1e-5)


def test_the_hybrid_is_surer_of_what_is_larger_and_no_less_of_what_is_higher():
    large, small = confidence(measure(), 'hybrid')
    assert large > small
    low = np.full(SHAPE, 0.101, np.float32)
    assert confidence(measure(height_m=low), 'hybrid')[0] <= large


def test_the_logistic_function_does_not_overflow():
    assert logistic(np.array([-1000.0, 0.0, 1000.0])).tolist() == [0, 0.5, 1]
