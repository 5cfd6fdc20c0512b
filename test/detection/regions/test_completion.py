"""Pixels without 3D that are obstacles because of their neighbourhood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.regions.completion import (
    dark_without_3d,
    rocks_in_regions,
    slope_beyond_border,
)
from rover_obstacle_detection.detection.regions.parameters import RegionParameters
from rover_obstacle_detection.detection.regions.regions import nearest_known

PARAMETERS = RegionParameters()
# A disparity is above that of the maximum range, 40 m, if it is above 0.25.
CAMERA = StereoCamera(16, 1, 100.0, 100.0, 7.5, 0.0, 0.1)


def row(values, dtype):
    return np.array([values], dtype)


def continued_rock(probability, *, regions=None, is_seed=True):
    """A row of which only the first pixel is matched, on a rock."""
    shape = (1, len(probability))
    high = np.zeros(shape, bool)
    high[0, 0] = True
    found = rocks_in_regions(
        high,
        row(probability, np.float32),
        ~high,
        nearest_known(high, np.full(shape, 100, np.float32)),
        np.ones(shape, np.int32) if regions is None else row(regions, np.int32),
        np.array([False, is_seed, is_seed]),
        PARAMETERS,
    )
    return found[0].astype(int).tolist()


def test_a_rock_continues_over_its_region_where_the_outline_filter_was_not_applied():
    assert continued_rock([0.9, np.nan, np.nan]) == [0, 1, 1]


def test_a_rock_does_not_continue_where_the_outline_filter_denies_it():
    assert continued_rock([0.9, 0.1, np.nan, 0.45, 0.02]) == [0, 0, 1, 1, 0]


def test_a_rock_does_not_continue_into_another_region():
    assert continued_rock([0.9, 0.9, 0.9, 0.9], regions=[1, 1, 2, 2]) == [0, 1, 0, 0]


def test_a_rock_does_not_continue_in_regions_without_enough_points():
    assert continued_rock([0.9, 0.9, 0.9], is_seed=False) == [0, 0, 0]


def dark(grey=10, *, expected=4.0, is_seed=False, camera=CAMERA, **changes):
    """Columns at which an image is dark without 3D; it is matched from column 12 on."""
    unmatched = row(np.arange(16) < 12, bool)
    found = dark_without_3d(
        np.full((1, 16), grey, np.uint8),
        np.full((1, 16), expected, np.float32),
        unmatched,
        np.ones((1, 16), np.int32),
        np.array([False, is_seed]),
        camera,
        replace(PARAMETERS, **changes),
    )
    return np.flatnonzero(found).tolist()


def test_dark_regions_without_points_are_found_where_the_right_image_shows_the_ground():
    assert dark() == list(range(4, 12))
    assert dark(expected=6.0) == list(range(6, 12))


def test_the_camera_offset_counts_for_the_shared_view():
    assert dark(camera=replace(CAMERA, cx_right=5.5)) == list(range(6, 12))


@pytest.mark.parametrize(
    'changes', [{'grey': 60}, {'is_seed': True}, {'expected': 0.2}, {'dark_grey_level': 5}]
)
def test_bright_far_and_seed_regions_are_not_dark(changes):
    assert dark(**changes) == []


WIDE = StereoCamera(100, 50, 100.0, 100.0, 49.5, 24.5, 0.1)


def continued_slope(steep_columns, disparity=20.0):
    """Columns of a slope beyond those that are measured, from column 20 on."""
    steep, measured = np.zeros((2, *WIDE.shape), bool)
    measured[:, 20:] = True
    steep[:, steep_columns] = True
    values = np.where(measured, disparity, 0).astype(np.float32)
    nearest = nearest_known(measured, np.full(WIDE.shape, 12, np.float32))
    found = slope_beyond_border(steep, nearest, values, WIDE, PARAMETERS)
    assert (found == found[0]).all()
    return np.flatnonzero(found[0]).tolist()


def test_a_slope_continues_into_the_border_not_visible_in_the_right_image():
    assert continued_slope(slice(20, 60)) == list(range(8, 20))


def test_a_slope_does_not_continue_where_the_right_image_shows_it():
    # With a smaller disparity, the unmeasured columns are in the right image as well.
    assert continued_slope(slice(20, 60), disparity=8.0) == list(range(8, 13))


def test_a_slope_that_ends_before_the_border_does_not_continue():
    assert continued_slope(slice(30, 60)) == []


def test_specks_of_a_slope_do_not_continue():
    steep, measured = np.zeros((2, *WIDE.shape), bool)
    measured[:, 20:] = True
    steep[10:13, 20:23] = True
    nearest = nearest_known(measured, np.full(WIDE.shape, 12, np.float32))
    disparity = np.where(measured, 20, 0).astype(np.float32)
    assert not slope_beyond_border(steep, nearest, disparity, WIDE, PARAMETERS).any()
    fine = replace(PARAMETERS, speck_share=0.001)
    assert slope_beyond_border(steep, nearest, disparity, WIDE, fine).any()
