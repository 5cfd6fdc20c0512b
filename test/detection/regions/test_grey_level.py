from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.regions.grey_level import dark_regions

REGIONS = np.array([[1, 1, 2, 2, 3, 3]], np.int32)
GREY = np.array([[49, 50, 200, 210, 10, 20]], np.uint8)


def test_dark_regions_without_points_are_found():
    is_seed = np.zeros(4, bool)
    np.testing.assert_array_equal(
        dark_regions(GREY, REGIONS, is_seed, 50), [False, True, False, True]
    )


def test_seed_regions_are_not_judged_by_their_grey_level():
    is_seed = np.array([False, False, False, True])
    np.testing.assert_array_equal(
        dark_regions(GREY, REGIONS, is_seed, 50), [False, True, False, False]
    )


def test_the_only_region_without_points_may_be_the_first():
    is_seed = np.array([False, False, True, True])
    assert dark_regions(GREY, REGIONS, is_seed, 50).tolist() == [False, True, False, False]


@pytest.mark.parametrize(('limit', 'dark'), [(49.5, False), (49.6, True)])
def test_regions_with_a_mean_below_the_threshold_are_dark(limit, dark):
    assert dark_regions(GREY, REGIONS, np.zeros(4, bool), limit)[1] == dark


def test_threshold_zero_finds_nothing():
    black = np.zeros((1, 6), np.uint8)
    assert not dark_regions(black, REGIONS, np.zeros(4, bool), 0).any()
