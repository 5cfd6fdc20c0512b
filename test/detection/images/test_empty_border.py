from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.images.empty_border import empty_border

BLOCK_PX = 3


def image(*blacks):
    grey = np.full((12, 16), 90, np.uint8)
    for black in blacks:
        grey[black] = 0
    return grey


def found(grey, reach_px=0):
    border = empty_border(grey, BLOCK_PX, reach_px)
    return np.zeros(grey.shape, np.bool_) if border is None else border


@pytest.mark.parametrize(
    'black',
    [np.s_[:1], np.s_[-4:], np.s_[:, :2], np.s_[:, -5:], np.s_[3:9, :4], np.s_[:, :]],
    ids=['row', 'bottom', 'left', 'right', 'patch', 'all'],
)
def test_black_at_the_edge_is_empty(black):
    grey = image(black)
    assert found(grey).dtype == np.bool_
    np.testing.assert_array_equal(found(grey), grey == 0)


@pytest.mark.parametrize(
    'black',
    [(), np.s_[3:9, 1:15], np.s_[0, 4], np.s_[2:4, :]],
    ids=['nothing', 'away from the edge', 'a pixel', 'a bar thinner than a block'],
)
def test_other_black_is_not(black):
    assert empty_border(image(black) if black else image(), BLOCK_PX, 0) is None


def test_almost_black_is_not():
    grey = image()
    grey[:4] = 1
    assert empty_border(grey, BLOCK_PX, 0) is None


def test_almost_black_beside_a_black_border_is_not():
    grey = image(np.s_[:4])
    grey[4:8] = 1
    np.testing.assert_array_equal(found(grey), grey == 0)


def test_a_black_post_before_a_black_border_is_not():
    grey = image(np.s_[:4], np.s_[4:, 7:9])
    np.testing.assert_array_equal(found(grey), image(np.s_[:4]) == 0)


def test_both_steps_of_a_slanting_border_are_empty():
    grey = image(np.s_[:2, :], np.s_[2:4, 5:])
    np.testing.assert_array_equal(found(grey), grey == 0)


@pytest.mark.parametrize('line', [np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]])
def test_a_line_of_one_pixel_at_any_edge_is_empty(line):
    np.testing.assert_array_equal(empty_border(image(line), 7, 0), image(line) == 0)


@pytest.mark.parametrize(('side_px', 'is_empty'), [(3, True), (2, False)])
def test_a_corner_that_half_a_block_fills_is_empty(side_px, is_empty):
    corner = image(np.s_[:side_px, :side_px])
    border = empty_border(corner, 7, 0)
    assert (border is not None) == is_empty
    if border is not None:
        np.testing.assert_array_equal(border, corner == 0)


def test_pixels_within_reach_count():
    np.testing.assert_array_equal(found(image(np.s_[:2]), 3), image(np.s_[:5]) == 0)


def test_the_image_is_not_changed():
    grey = image(np.s_[:2])
    grey.flags.writeable = False
    assert found(grey).any()
