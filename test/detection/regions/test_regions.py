from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.regions.regions import (
    carried,
    nearest_known,
    region_counts,
    region_means,
    region_sizes,
    seed_regions,
)

REGIONS = np.array([[1, 1, 2], [3, 3, 3]], np.int32)


def test_sizes_counts_and_means():
    where = np.array([[True, False, False], [True, True, False]])
    values = np.array([[10, 20, 30], [0, 6, 9]], np.uint8)
    np.testing.assert_array_equal(region_sizes(REGIONS), [0, 2, 1, 3])
    np.testing.assert_array_equal(region_counts(REGIONS, where), [0, 1, 0, 2])
    np.testing.assert_allclose(region_means(REGIONS, values), [0, 15, 30, 5])


def test_means_of_large_regions_do_not_overflow():
    regions = np.ones((600, 800), np.int32)
    assert region_means(regions, np.full((600, 800), 255, np.uint8))[1] == 255


def test_counts_cover_regions_without_any():
    nowhere = np.zeros_like(REGIONS, bool)
    np.testing.assert_array_equal(region_counts(REGIONS, nowhere), [0, 0, 0, 0])


@pytest.mark.parametrize(('points', 'seed'), [(9, False), (10, True), (11, True)])
def test_so_many_points_or_more_make_a_seed(points, seed):
    regions = np.ones((4, 5), np.int32)
    has_point = (np.arange(20) < points).reshape(4, 5)
    np.testing.assert_array_equal(seed_regions(regions, has_point, 10), [False, seed])


def row(*values, dtype=bool):
    return np.array([values], dtype)


def carry(known, values, regions=None, reach=100.0):
    known = row(*known)
    nearest = nearest_known(known, np.broadcast_to(np.float32(reach), known.shape))
    regions = None if regions is None else row(*regions, dtype=np.int32)
    return carried(row(*values), nearest, regions)[0].astype(int).tolist()


def test_values_are_carried_from_the_nearest_known_pixel():
    assert carry([1, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0]) == [0, 1, 1, 0, 0, 0]
    assert carry([1, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 1]) == [0, 0, 0, 1, 1, 0]


def test_values_of_unknown_pixels_count_for_nothing():
    assert carry([1, 0, 0], [0, 1, 1]) == [0, 0, 0]


def test_values_stay_within_their_region():
    assert carry([1, 0, 0, 0, 0], [1, 0, 0, 0, 0], regions=[1, 1, 1, 2, 2]) == [0, 1, 1, 0, 0]


def test_values_are_carried_as_far_as_the_pixel_they_come_from_reaches():
    assert carry([1, 0, 0, 0, 0], [1, 0, 0, 0, 0], reach=2.5) == [0, 1, 1, 0, 0]
    assert carry([1, 0], [1, 0], reach=0.0) == [0, 0]


@pytest.mark.parametrize('known', [0, 1])
def test_where_all_or_nothing_is_known_nothing_is_carried(known):
    assert carry([known] * 3, [1, 1, 1]) == [0, 0, 0]
