from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.stereo.semi_global import (
    Penalties,
    disparity_range,
    penalties,
    plain_disparity,
    semi_global_match,
)

WIDTH, HEIGHT = 200, 80
OWN = Penalties(300, 1200)


def camera(offset=0.0, width=WIDTH, height=HEIGHT, fx=200.0):
    cx = (width - 1) / 2
    return StereoCamera(width, height, fx, fx, cx, (height - 1) / 2, 0.1, cx_right=cx - offset)


def shifted_pair(disparity):
    """Texture smooth over three pixels, and what the right eye sees of it."""
    noise = np.random.default_rng(5).uniform(0, 255, (HEIGHT, WIDTH + 200)).astype(np.float32)
    texture = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 1.0), None, 20, 235, cv2.NORM_MINMAX)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    left = cv2.remap(texture, columns + 50, rows, cv2.INTER_CUBIC)
    right = cv2.remap(texture, columns + 50 + np.float32(disparity), rows, cv2.INTER_CUBIC)
    return tuple(np.rint(image).astype(np.uint8) for image in (left, right))


def assert_mostly(found, expected, tolerance=0.07):
    """All but a hundredth of the pixels; smoothness makes good the last few at the edges."""
    assert (np.abs(found - np.float32(expected)) <= tolerance).mean() > 0.98


def matched(pair, count=32, offset=0.0, **config):
    return plain_disparity(
        *pair, camera(offset), count, DetectorConfig(method='study', **config), OWN
    )


@pytest.mark.parametrize('disparity', [1, 7, 20])
def test_whole_shift_is_found_everywhere_but_in_the_blind_border(disparity):
    found = matched(shifted_pair(disparity))
    assert found.dtype == np.float32
    assert found.shape == (HEIGHT, WIDTH)
    assert_mostly(found[:, 32:], disparity)


@pytest.mark.parametrize('disparity', [5.25, 8.5, 12.75])
def test_shift_between_pixels_is_found(disparity):
    found = matched(shifted_pair(disparity))[:, 32:]
    assert (found > 0).mean() > 0.99
    # Interpolation between costs draws towards whole pixels: a third of one at the most.
    assert np.abs(np.median(found) - disparity) < 0.2
    assert np.quantile(np.abs(found[found > 0] - disparity), 0.95) < 0.35


@pytest.mark.parametrize(('count', 'lowest'), [(16, 0), (32, 0), (16, 5), (16, -4)])
def test_blind_left_border_has_no_disparity(count, lowest):
    found = matched(shifted_pair(8), count, min_disparity=lowest)
    border = lowest + count - 1
    assert (found[:, :border] == 0).all()
    assert_mostly(found[:, border + 1 : WIDTH - 5], 8)


@pytest.mark.parametrize('offset', [6.0, 2.5, -3.0])
def test_offset_of_the_camera_is_taken_off(offset):
    found = matched(shifted_pair(10), offset=offset)
    assert_mostly(found[:, 32:], 10 - offset)


def test_disparity_beyond_infinity_is_no_match():
    assert not matched(shifted_pair(5), offset=6.0).any()


def test_negative_search_finds_what_lies_left():
    found = matched(shifted_pair(-4), min_disparity=-16, offset=-10.0)
    assert_mostly(found[:, 20:-20], 6)


def test_sixteenths_of_a_pixel():
    fixed = semi_global_match(*shifted_pair(7), 2, 16, DetectorConfig(method='study'), OWN)
    assert fixed.dtype == np.int16
    assert fixed.shape == (HEIGHT, WIDTH)
    assert_mostly(fixed[:, 20:], 7 * 16, 1)
    assert (fixed[:, :2] == (2 - 1) * 16).all()


@pytest.mark.parametrize(('lowest', 'count'), [(0, 208), (-100, 208), (190, 16), (0, 4096)])
@pytest.mark.parametrize('mode', [0, 2])
def test_range_wider_than_the_image_matches_nothing(lowest, count, mode):
    config = DetectorConfig(method='study', sgbm_mode=mode)
    fixed = semi_global_match(*shifted_pair(7), lowest, count, config, OWN)
    assert fixed.dtype == np.int16
    assert (fixed == (lowest - 1) * 16).all()


@pytest.mark.parametrize('mode', [0, 1, 2, 3])
def test_every_mode_matches(mode):
    found = matched(shifted_pair(9), sgbm_mode=mode)
    assert_mostly(found[:, 32:], 9)


def test_penalties_are_the_methods_own_unless_given():
    assert penalties(DetectorConfig(), OWN) == OWN
    assert penalties(DetectorConfig(P1=100.0), OWN) == Penalties(100, 1200)
    assert penalties(DetectorConfig(P1=100.0, P2=900.0), OWN) == Penalties(100, 900)


@given(one=st.floats(0, 100000), more=st.floats(0, 100000))
def test_larger_change_always_costs_more(one, more):
    if one and more and more <= one:
        return
    found = penalties(DetectorConfig(P1=one, P2=more), OWN)
    assert 0 < found.one < found.more


def test_range_follows_camera_and_nearest_distance():
    # 200 px * 0.1 m / 0.5 m = 40, one more to interpolate: 41 fits into 48.
    assert disparity_range(camera(), 0.5) == 48
    assert disparity_range(camera(), 2.0) == 16
    assert disparity_range(camera(fx=400.0), 0.5) == 96
    assert disparity_range(camera(offset=10.0), 0.5) == 64
    assert disparity_range(camera(offset=-10.0), 0.5) == 48


@given(nearest=st.floats(0.01, 100), width=st.integers(32, 4000), offset=st.floats(-50, 50))
def test_range_covers_the_nearest_distance_or_the_image(nearest, width, offset):
    each = camera(offset, width)
    count = disparity_range(each, nearest)
    assert count % 16 == 0
    assert 16 <= count <= max(16, 0.8 * width)
    assert count > each.disparity_at(nearest) + offset or count > 0.8 * width - 16
