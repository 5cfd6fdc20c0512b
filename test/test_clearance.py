from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.clearance import grown_from_cores, small_parts

CORE, FOOT = 0.10, 0.03


def profile():
    """A rock of 5 pixels over the core in a foot of 9, and a bump that stays below the core."""
    height = np.zeros((9, 24), np.float32)
    height[2:7, 2:11] = 0.05
    height[4, 4:9] = 0.2
    height[2:7, 14:22] = 0.09
    return height


def test_cores_grow_down_to_the_foot():
    found = grown_from_cores(profile(), CORE, FOOT, 5)
    expected = np.zeros_like(found)
    expected[2:7, 2:11] = True
    np.testing.assert_array_equal(found, expected)
    assert found.dtype == np.bool_


def test_too_few_core_pixels_are_noise():
    assert not grown_from_cores(profile(), CORE, FOOT, 6).any()


def test_heights_at_the_limits_are_ground():
    height = np.full((4, 4), 0.1, np.float32)
    assert not grown_from_cores(height, np.float32(0.1), FOOT, 1).any()
    assert grown_from_cores(height, np.float32(0.0999), FOOT, 1).all()


def test_growing_goes_over_corners():
    height = np.eye(5, dtype=np.float32) * 0.05
    height[0, 0] = 0.2
    np.testing.assert_array_equal(grown_from_cores(height, CORE, FOOT, 1), np.eye(5, dtype=bool))


def test_unknown_heights_are_neither_core_nor_foot():
    height = profile()
    height[:, 6] = np.nan
    found = grown_from_cores(height, CORE, FOOT, 1)
    assert not found[:, 6].any()
    assert found[4, 4]
    assert not grown_from_cores(np.full((3, 3), np.nan, np.float32), CORE, FOOT, 1).any()


def test_limits_may_vary_over_the_image():
    height = np.full((3, 6), 0.15, np.float32)
    core = np.full((3, 6), 0.1, np.float32)
    core[:, 3:] = 0.2
    foot = np.full((3, 6), 0.05, np.float32)
    foot[:, 5] = np.inf
    found = grown_from_cores(height, core, foot, 9)
    np.testing.assert_array_equal(found, np.tile([1, 1, 1, 1, 1, 0], (3, 1)).astype(bool))


@pytest.mark.parametrize('height', [0.0, -0.5])
def test_flat_ground_and_hollows_are_not_above_anything(height):
    assert not grown_from_cores(np.full((5, 5), height, np.float32), CORE, FOOT, 1).any()


def test_small_parts_are_those_under_the_size():
    mask = np.zeros((6, 12), bool)
    mask[1, 1:4] = True
    mask[3:5, 6:8] = True
    mask[2, 4] = True
    expected = np.zeros_like(mask)
    assert not small_parts(mask, 4).any()
    expected[1, 1:4] = expected[2, 4] = expected[3:5, 6:8] = True
    np.testing.assert_array_equal(small_parts(mask, 5), expected)
