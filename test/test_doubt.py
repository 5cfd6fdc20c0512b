"""What is more likely no obstacle is taken back, and is not free either."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection.detection.cue import Cue
from rover_obstacle_detection.detection.hybrid import without_doubtful

ROCK, SPECK = np.s_[32:44, 30:44], np.s_[4:8, 10:22]


def found(min_confidence):
    """A rock that the outline filter is sure of, and a speck of noisy, steep ground."""
    made = small_detection()
    mask, cues, noise = made.mask.copy(), made.cues.copy(), made.height_noise.copy()
    mask[SPECK], cues[SPECK], noise[SPECK] = 255, Cue.SLOPE, 0.2
    probability = np.full(mask.shape, np.nan, np.float32)
    probability[ROCK] = 0.99
    products = {'mask': mask, 'cues': cues, 'height_noise': noise, 'rock_probability': probability}
    config = replace(made.config, min_confidence=min_confidence)
    return replace(made, config=config, products={**made.products, **products})


def test_the_doubtful_is_neither_obstacle_nor_free():
    before = found(0.2)
    assert before.confidence[ROCK].min() > 0.9
    assert before.confidence[SPECK].max() < 0.2
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


@pytest.mark.parametrize(('min_confidence', 'left'), [(0.0, 2), (1.0, 0)])
def test_how_sure_is_sure_enough_is_a_parameter(min_confidence, left):
    before = found(min_confidence)
    after = without_doubtful(before)
    assert len(after.obstacles) == left
    assert (after is before) == (left == 2)
