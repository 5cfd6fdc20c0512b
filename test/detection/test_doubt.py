"""Specks of noisy ground are taken back, and are not free either; nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection.detection.hybrid import without_doubtful
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import Detection

ROCK, SPECK, SLOPE = np.s_[32:44, 30:44], np.s_[12:14, 10:13], np.s_[2:10, 4:60]


def found(min_confidence=0.9, where=SPECK, cue=Cue.SLOPE, noise_px=0.2):
    """A rock that the outline filter is sure of, and too steep ground, in a noisy pair."""
    made = small_detection()
    mask, cues = made.mask.copy(), made.cues.copy()
    mask[where] = 255
    cues[where] |= np.uint8(cue)
    noise = np.random.default_rng(0).normal(0, noise_px, mask.shape).astype(np.float32)
    disparity = np.where(made.disparity > 0, made.disparity + noise, 0).astype(np.float32)
    probability = np.full(mask.shape, np.nan, np.float32)
    probability[ROCK] = 0.99
    products = {
        'mask': mask,
        'cues': cues,
        'disparity': disparity,
        'rock_probability': probability,
    }
    config = replace(made.config, min_confidence=min_confidence)
    return replace(made, config=config, products={**made.products, **products})


def test_a_doubtful_speck_is_neither_obstacle_nor_free():
    before = found()
    assert before.confidence[SPECK].max() < 0.9
    after = without_doubtful(before)
    assert len(after.obstacles) == 1
    assert (after.mask[ROCK] == 255).all()
    assert not after.mask[SPECK].any()
    assert not after.cues[SPECK].any()
    assert not after.known[SPECK].any()
    elsewhere = np.ones(after.mask.shape, bool)
    elsewhere[SPECK] = False
    assert (after.known == (before.known & elsewhere)).all()
    assert len(after.ground_points) == (before.mask[before.known] == 0).sum()


def test_in_a_clear_pair_it_is_not_doubted():
    before = found(noise_px=0.0)
    assert before.confidence[SPECK].min() > 0.9
    assert without_doubtful(before) is before


def test_how_sure_is_sure_enough_is_a_parameter():
    before = found(min_confidence=0.0)
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
def test_what_is_large_or_stands_up_is_never_doubted(where, cue):
    before = found(1.0, where, cue)
    assert without_doubtful(before) is before


def test_a_detection_does_not_hold_on_to_the_one_that_it_came_of():
    after = without_doubtful(found())
    held = [cell.cell_contents for cell in after.products['known'].__closure__ or ()]
    assert held
    assert not any(isinstance(each, Detection) for each in held)
