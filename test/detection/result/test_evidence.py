from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.result.confidence import FEATURES
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.evidence import (
    measure_evidence,
    seen_disparity_noise_px,
)
from rover_obstacle_detection.detection.result.parameters import ResultParameters

SHAPE = (20, 30)
LARGE, SMALL = np.s_[2:12, 3:13], np.s_[15:17, 20:25]
PARAMETERS = ResultParameters(max_step_m=0.1, block_size_px=5)
TYPICAL_NOISE_PX = PARAMETERS.typical_noise_px


def two_obstacles():
    numbers = np.zeros(SHAPE, np.int32)
    numbers[LARGE], numbers[SMALL] = 1, 2
    return numbers


def measure(numbers=None, **changes):
    """Two obstacles of 100 and 10 pixels, 0.06 m and 0.02 m above the step.

    Their noise is 0.02 m for a pair with typical disparity noise.
    """
    numbers = two_obstacles() if numbers is None else numbers
    height = np.zeros(SHAPE, np.float32)
    height[LARGE], height[SMALL] = 0.16, 0.12
    given = {
        'grey': np.full(SHAPE, 100, np.uint8),
        'disparity': np.full(SHAPE, 8, np.float32),
        'height_m': height,
        'noise_m': np.full(SHAPE, 0.02, np.float32),
        'rock_probability': np.full(SHAPE, np.nan, np.float32),
        'cues': np.where(numbers, Cue.HEIGHT, 0).astype(np.uint8),
        'parameters': PARAMETERS,
        **changes,
    }
    given['noise_m'] = given['noise_m'] * as_typical(given['disparity'])
    return measure_evidence(numbers, images=ImageParameters(), **given)


def as_typical(disparity):
    return np.float32(TYPICAL_NOISE_PX / seen_disparity_noise_px(disparity, PARAMETERS))


def test_excess_is_in_standard_deviations_of_independent_samples():
    # With blocks of 5 x 5, 100 pixels are four samples and ten are one.
    assert measure().excess == pytest.approx([3 * 2, 1], rel=1e-5)
    assert measure(parameters=replace(PARAMETERS, block_size_px=1)).excess == pytest.approx(
        [3 * 10, 10**0.5], rel=1e-5
    )


def test_excess_counts_only_pixels_above_the_step():
    height = np.full(SHAPE, 0.05, np.float32)
    height[2:7, 3:13] = 0.20
    excess = measure(height_m=height).excess
    assert excess == pytest.approx([5 * 2**0.5, 0], rel=1e-5)


def test_excess_uses_the_noise_of_the_pixels_above_the_step():
    noise = np.full(SHAPE, 0.5, np.float32)
    noise[LARGE] = 0.01
    assert measure(noise_m=noise).excess[0] == pytest.approx(12, rel=1e-5)


def test_noisier_pair_lowers_the_excess_of_the_same_height():
    disparity = (20 + np.random.default_rng(3).normal(0, 0.4, SHAPE)).astype(np.float32)
    given = {
        'grey': np.full(SHAPE, 100, np.uint8),
        'height_m': np.full(SHAPE, 0.16, np.float32),
        'noise_m': np.full(SHAPE, 0.02, np.float32),
        'rock_probability': np.full(SHAPE, np.nan, np.float32),
        'cues': np.zeros(SHAPE, np.uint8),
        'parameters': PARAMETERS,
        'images': ImageParameters(),
    }
    noisy = measure_evidence(two_obstacles(), disparity=disparity, **given)
    assert noisy.disparity_noise_px == pytest.approx(0.4, rel=0.15)
    assert noisy.excess[0] == pytest.approx(3 * 2 * TYPICAL_NOISE_PX / noisy.disparity_noise_px)
    clean = measure_evidence(two_obstacles(), disparity=np.full(SHAPE, 20, np.float32), **given)
    assert clean.disparity_noise_px < 0.1 * noisy.disparity_noise_px
    assert clean.excess[0] > 10 * noisy.excess[0]


def test_disparity_noise_is_measured_on_slopes_and_across_jumps():
    rng = np.random.default_rng(1)
    ramp = np.tile(np.linspace(10, 60, 400), (300, 1))
    noisy = (ramp + rng.normal(0, 0.3, ramp.shape)).astype(np.float32)
    assert seen_disparity_noise_px(noisy, PARAMETERS) == pytest.approx(0.3, rel=0.05)
    assert seen_disparity_noise_px(ramp.astype(np.float32), PARAMETERS) < 0.02
    noisy[:, 200:] += 500
    assert seen_disparity_noise_px(noisy, PARAMETERS) == pytest.approx(0.3, rel=0.15)


def test_disparity_noise_is_measured_on_matches_only_also_below_a_pixel():
    random = np.random.default_rng(2)
    far = (0.5 + random.normal(0, 0.05, (300, 400))).astype(np.float32)
    assert seen_disparity_noise_px(far, PARAMETERS) == pytest.approx(0.05, rel=0.05)
    with_holes = np.where(random.random(far.shape) < 0.25, np.float32(0), far + 20)
    assert seen_disparity_noise_px(with_holes, PARAMETERS) == pytest.approx(0.05, rel=0.05)


def test_disparity_noise_is_measured_in_the_narrowest_image_that_shows_it():
    spacing = PARAMETERS.noise_spacing_px
    noisy = 20 + np.random.default_rng(4).normal(0, 0.4, (3000, 2 * spacing + 1))
    assert seen_disparity_noise_px(noisy.astype(np.float32), PARAMETERS) == pytest.approx(
        0.4, rel=0.1
    )
    narrower = noisy[:, 1:].astype(np.float32)
    assert seen_disparity_noise_px(narrower, PARAMETERS) == TYPICAL_NOISE_PX


@pytest.mark.parametrize('shape', [(20, 30), (2, 3), (1, 1)])
def test_disparity_noise_is_typical_without_matches(shape):
    assert seen_disparity_noise_px(np.zeros(shape, np.float32), PARAMETERS) == TYPICAL_NOISE_PX


def test_pixels_and_share_with_3d():
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


def test_shares_of_cues_and_of_their_agreement():
    cues = np.zeros(SHAPE, np.uint8)
    cues[LARGE] = Cue.HEIGHT
    cues[2:4, 3:13] |= np.uint8(Cue.SLOPE)
    cues[15, 20:25] = Cue.GREY_LEVEL
    evidence = measure(cues=cues)
    shares = dict(zip(Cue, evidence.cue_shares.T, strict=True))
    assert shares[Cue.HEIGHT] == pytest.approx([1, 0])
    assert shares[Cue.SLOPE] == pytest.approx([0.2, 0])
    assert shares[Cue.GREY_LEVEL] == pytest.approx([0, 0.5])
    assert not shares[Cue.DROP].any()
    assert evidence.agreement == pytest.approx([0.2, 0])


def test_network_counts_where_its_cues_make_the_obstacle():
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


def test_ground_too_steep_or_low_has_features_of_its_own():
    cues = np.full(SHAPE, Cue.SLOPE, np.uint8)
    cues[SMALL] = Cue.HEIGHT
    evidence = measure(cues=cues)
    assert evidence.ground_share.tolist() == [1, 0]
    features = dict(zip(FEATURES, evidence.features().T, strict=True))
    assert features['ground_log_pixels'] == pytest.approx([np.log(100), 0])
    noise_share = 0.02 * as_typical(np.full(SHAPE, 8, np.float32)) / 0.10
    assert features['ground_log_noise'] == pytest.approx(
        [np.log(noise_share + PARAMETERS.min_noise_share), 0], rel=1e-5
    )


def test_contrast_is_high_where_the_outline_follows_an_edge():
    grey = np.full(SHAPE, 100, np.uint8)
    assert measure(grey=grey).contrast == pytest.approx([1, 1])
    grey[LARGE] = 160
    large, small = measure(grey=grey).contrast
    assert large > 5
    assert small < 2


def test_raggedness_is_the_outline_over_the_root_of_the_area():
    numbers = np.zeros(SHAPE, np.int32)
    numbers[2:12, 3:13] = 1  # 36 of 100 pixels
    numbers[15, 2:27] = 2  # a line
    numbers[18, 5] = 3  # a dot
    numbers[0:2, 20:30] = 4  # at the border: 11 of 20 pixels
    assert measure(numbers).raggedness == pytest.approx([3.6, 5, 1, 11 / 20**0.5])


def test_features_are_in_the_order_of_their_names():
    features = dict(zip(FEATURES, measure().features().T, strict=True))
    assert features['intercept'].tolist() == [1, 1]
    assert features['log_excess'] == pytest.approx(np.log([7, 2]), rel=1e-5)
    assert features['log_pixels'] == pytest.approx(np.log([100, 10]))
    assert features['log_contrast'] == pytest.approx([0, 0])
    assert features['log_raggedness'] == pytest.approx(np.log([3.6, 1.0 * 10**0.5]))
    noise_px = seen_disparity_noise_px(np.full(SHAPE, 8, np.float32), PARAMETERS)
    assert features['log_disparity_noise'] == pytest.approx(np.log([noise_px] * 2))
    assert features['rock_log_odds'].tolist() == [0, 0]
    assert features['ground_log_pixels'].tolist() == [0, 0]
    assert features['height_share'].tolist() == [1, 1]
    assert features['roughness_step_share'].tolist() == [0, 0]


def test_nothing_is_measured_without_obstacles():
    features = measure(np.zeros(SHAPE, np.int32)).features()
    assert features.shape == (0, len(FEATURES))


def test_a_single_far_pixel_is_measured_like_others():
    numbers = np.zeros(SHAPE, np.int32)
    numbers[8, 12] = 1
    grey = np.full(SHAPE, 100, np.uint8)
    grey[:, 12:] = 160
    far = np.full(SHAPE, 0.5, np.float32)
    evidence = measure(numbers, grey=grey, disparity=far)
    assert evidence.measured_share == pytest.approx([1])
    assert evidence.noise_share == pytest.approx([0.02 * as_typical(far) / 0.10], rel=1e-5)
    assert evidence.contrast[0] > 5
