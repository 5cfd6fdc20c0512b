from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.regions.regions import (
    carried,
    nearest_known,
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


def row(*values, dtype=bool):
    return np.array([values], dtype)


def carry(known, values, regions=None, reach=100.0):
    known = row(*known)
    nearest = nearest_known(known, np.broadcast_to(np.float32(reach), known.shape))
    regions = None if regions is None else row(*regions, dtype=np.int32)
    return carried(row(*values), nearest, regions)[0].astype(int).tolist()


def test_values_are_copied_from_the_nearest_known_pixel():
    assert carry([1, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0]) == [0, 1, 1, 0, 0, 0]
    assert carry([1, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 1]) == [0, 0, 0, 1, 1, 0]


def test_values_of_unknown_pixels_are_ignored():
    assert carry([1, 0, 0], [0, 1, 1]) == [0, 0, 0]


def test_values_stay_within_their_region():
    assert carry([1, 0, 0, 0, 0], [1, 0, 0, 0, 0], regions=[1, 1, 1, 2, 2]) == [0, 1, 1, 0, 0]


def test_values_are_copied_up_to_the_reach_of_their_source():
    assert carry([1, 0, 0, 0, 0], [1, 0, 0, 0, 0], reach=2.5) == [0, 1, 1, 0, 0]
    assert carry([1, 0], [1, 0], reach=0.0) == [0, 0]


@pytest.mark.parametrize('known', [0, 1])
def test_nothing_is_copied_if_all_or_no_pixels_are_known(known):
    assert carry([known] * 3, [1, 1, 1]) == [0, 0, 0]
