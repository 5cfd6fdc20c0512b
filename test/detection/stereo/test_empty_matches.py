from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.empty_matches import remove_empty_matches
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters

SHAPE = (40, 60)
PARAMETERS = StereoParameters()
GREY = np.full(SHAPE, 90, np.uint8)


def black(where):
    image = GREY.copy()
    image[where] = 0
    return image


def kept(left, right, offset=0.0, rows=STRAIGHT, sky=None):
    camera = StereoCamera(60, 40, 50.0, 50.0, 29.5, 19.5, 0.1, cx_right=29.5 - offset)
    disparity = np.full(SHAPE, 6, np.float32)
    remove_empty_matches(disparity, (left, right), camera, PARAMETERS, rows, sky)
    assert set(np.unique(disparity)) <= {0, 6}
    return disparity > 0


def all_but(where):
    expected = np.ones(SHAPE, np.bool_)
    expected[where] = False
    return expected


def test_matches_in_and_beside_the_left_border_are_removed():
    np.testing.assert_array_equal(kept(black(np.s_[-5:]), GREY), all_but(np.s_[-9:]))


@pytest.mark.parametrize('offset', [0.0, 5.0])
def test_matches_that_land_in_or_beside_the_right_border_are_removed(offset):
    right = black(np.s_[:, :10])
    last = round(14 + 6 + offset)
    np.testing.assert_array_equal(kept(GREY, right, offset), all_but(np.s_[:, :last]))


def test_rows_that_are_off_land_elsewhere():
    found = kept(GREY, black(np.s_[-5:]), rows=RowAlignment(3.0))
    np.testing.assert_array_equal(found, all_but(np.s_[-12:]))


def test_matches_of_a_narrow_post_before_black_sky_stay():
    sky = np.indices(SHAPE)[0] < 20
    left, right = black(np.s_[:30, 10:]), black(np.s_[:30, 4:])
    left[:30, 30:36] = right[:30, 24:30] = 90
    found = kept(left, right, sky=sky)
    assert found[:20, 32:34].all()
    assert not found[:20, 36:].any()
    assert not found[20:30, 20:].any()


def test_other_matches_stay():
    assert kept(GREY, black(np.s_[10:30, 10:50])).all()
