from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.regions.regions import (
    region_means,
    seed_regions,
)

REGIONS = np.array([[1, 1, 2], [3, 3, 3]], np.int32)


def test_means_of_each_region():
    values = np.array([[10, 20, 30], [0, 6, 9]], np.uint8)
    np.testing.assert_allclose(region_means(REGIONS, values), [0, 15, 30, 5])


def test_means_of_large_regions_do_not_overflow():
    regions = np.ones((600, 800), np.int32)
    assert region_means(regions, np.full((600, 800), 255, np.uint8))[1] == 255


@pytest.mark.parametrize(('points', 'seed'), [(9, False), (10, True), (11, True)])
def test_seed_regions_have_at_least_the_given_number_of_points(points, seed):
    regions = np.ones((4, 5), np.int32)
    has_point = (np.arange(20) < points).reshape(4, 5)
    np.testing.assert_array_equal(seed_regions(regions, has_point, 10), [False, seed])


def test_regions_without_points_are_no_seeds():
    where = np.array([[True, False, False], [False, False, False]])
    np.testing.assert_array_equal(seed_regions(REGIONS, where, 1), [False, True, False, False])
