from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import FREE, OBSTACLE
from rover_obstacle_detection.detection.result.specks import (
    around,
    combined_cues,
    without_doubtful,
)

ROCK, SPECK, SLOPE = np.s_[32:44, 30:44], np.s_[12:14, 10:13], np.s_[2:10, 4:60]
SHAPE = (48, 64)


def mask_of(*areas):
    mask = np.zeros(SHAPE, bool)
    for area in areas:
        mask[area] = True
    return mask


def test_cues_of_an_obstacle_add_up():
    found = {Cue.HEIGHT: mask_of(ROCK), Cue.SLOPE: mask_of(SLOPE), Cue.GREY_LEVEL: mask_of(ROCK)}
    cues, mask = combined_cues(found, None, 12)
    expected = np.zeros(SHAPE, np.uint8)
    expected[ROCK], expected[SLOPE] = Cue.HEIGHT | Cue.GREY_LEVEL, Cue.SLOPE
    np.testing.assert_array_equal(cues, expected)
    np.testing.assert_array_equal(mask, np.where(expected, OBSTACLE, FREE))
    assert mask.dtype == np.uint8


def test_surroundings_of_an_obstacle_are_a_disc():
    mask = np.zeros((9, 9), np.uint8)
    mask[4, 4] = OBSTACLE
    rows, columns = np.mgrid[:9, :9]
    found = around(mask, 2)
    squared_px = (rows - 4) ** 2 + (columns - 4) ** 2
    assert found[squared_px <= 4].all()
    assert not found[squared_px > 5].any()


def test_specks_are_no_obstacles():
    cues, mask = combined_cues({Cue.HEIGHT: mask_of(ROCK, SPECK)}, None, 12)
    np.testing.assert_array_equal(mask > 0, mask_of(ROCK))
    np.testing.assert_array_equal(cues > 0, mask_of(ROCK))


def test_two_cues_together_may_be_large_enough():
    beside = np.s_[12:14, 13:16]
    found = {Cue.HEIGHT: mask_of(SPECK), Cue.GREY_LEVEL: mask_of(beside)}
    cues, mask = combined_cues(found, None, 12)
    np.testing.assert_array_equal(mask > 0, mask_of(SPECK, beside))
    assert (cues[beside] == Cue.GREY_LEVEL).all()


def test_rover_is_no_obstacle():
    excluded = mask_of(np.s_[38:, :])
    cues, mask = combined_cues({Cue.HEIGHT: mask_of(ROCK)}, excluded, 12)
    np.testing.assert_array_equal(mask > 0, mask_of(ROCK) & ~excluded)
    assert not cues[excluded].any()


def detection(min_confidence=0.9, where=SPECK, cue=Cue.SLOPE, noise_px=0.2):
    """A rock that the network is confident of, and too steep ground, in a noisy pair."""
    made = small_detection()
    mask, cues = made.mask.copy(), made.cues.copy()
    mask[where] = OBSTACLE
    cues[where] |= np.uint8(cue)
    noise = np.random.default_rng(0).normal(0, noise_px, mask.shape).astype(np.float32)
    probability = np.full(mask.shape, np.nan, np.float32)
    probability[ROCK] = 0.99
    return replace(
        made,
        parameters=DetectorParameters.from_config(
            DetectorConfig(min_confidence=min_confidence, ground_cell=0.0)
        ),
        mask=mask,
        cues=cues,
        disparity=np.where(made.disparity > 0, made.disparity + noise, 0).astype(np.float32),
        rock_probability=probability,
    )


def test_doubtful_speck_becomes_unknown():
    before = detection()
    assert before.confidence[SPECK].max() < 0.9
    after = without_doubtful(before)
    assert len(after.obstacles) == 1
    assert (after.mask[ROCK] == OBSTACLE).all()
    assert not after.mask[SPECK].any()
    assert not after.cues[SPECK].any()
    np.testing.assert_array_equal(after.known, before.known & ~mask_of(SPECK))
    assert len(after.ground_points) == (before.mask[before.known] == FREE).sum()


def test_speck_in_a_clean_pair_is_not_doubtful():
    before = detection(noise_px=0.0)
    assert before.confidence[SPECK].min() > 0.9
    assert without_doubtful(before) is before


def test_nothing_is_doubtful_without_a_minimum_confidence():
    before = detection(min_confidence=0.0)
    assert without_doubtful(before) is before


@pytest.mark.parametrize(
    ('where', 'cue'),
    [
        (SLOPE, Cue.SLOPE),
        (SLOPE, Cue.DROP),
        (SPECK, Cue.HEIGHT),
        (SPECK, Cue.GREY_LEVEL),
        (SPECK, Cue.ROUGHNESS_STEP),
        (SPECK, Cue.SLOPE | Cue.HEIGHT),
        (ROCK, Cue.SLOPE),
    ],
    ids=str,
)
def test_large_areas_and_what_stands_up_are_never_removed(where, cue):
    before = detection(1.0, where, cue)
    assert before.confidence[where].max() < 1
    assert without_doubtful(before) is before


def test_result_does_not_keep_the_first_detection_in_memory():
    before = detection()
    after = without_doubtful(before)
    assert after is not before
    reference = weakref.ref(before)
    del before
    gc.collect()
    assert reference() is None
    assert after.obstacles
