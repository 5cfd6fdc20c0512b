from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.semi_global import (
    SUBPIXELS,
    Penalties,
    chosen_penalties,
    disparity_range,
    plain_disparity,
    semi_global_match,
)

WIDTH, HEIGHT = 200, 80
PENALTIES = Penalties(300, 1200)


def camera(offset=0.0, width=WIDTH, fx=200.0):
    cx = (width - 1) / 2
    return StereoCamera(width, HEIGHT, fx, fx, cx, (HEIGHT - 1) / 2, 0.1, cx_right=cx - offset)


def shifted_pair(disparity):
    """Texture smooth over three pixels, shifted by a disparity."""
    noise = np.random.default_rng(5).uniform(0, 255, (HEIGHT, WIDTH + 200)).astype(np.float32)
    texture = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 1.0), None, 20, 235, cv2.NORM_MINMAX)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    left = cv2.remap(texture, columns + 50, rows, cv2.INTER_CUBIC)
    right = cv2.remap(texture, columns + 50 + np.float32(disparity), rows, cv2.INTER_CUBIC)
    return tuple(np.rint(image).astype(np.uint8) for image in (left, right))


def assert_mostly(found, expected, tolerance=0.07):
    """All but 2 % of the pixels: the last few at the edges are less exact."""
    assert (np.abs(found - np.float32(expected)) <= tolerance).mean() > 0.98


def matched(pair, count=32, offset=0.0, **parameters):
    # The study, the only method that matches without a ground plane, has blocks of 5 px.
    p = StereoParameters(block_size_px=5, **parameters)
    return plain_disparity(*pair, camera(offset), count, PENALTIES, p)


@pytest.mark.parametrize('disparity', [1, 7, 20])
def test_whole_disparity_is_exact_right_of_the_blind_border(disparity):
    found = matched(shifted_pair(disparity))
    assert found.dtype == np.float32
    assert_mostly(found[:, 32:], disparity)


@pytest.mark.parametrize('disparity', [5.25, 8.5, 12.75])
def test_fractional_disparity_is_found_to_a_third_of_a_pixel(disparity):
    found = matched(shifted_pair(disparity))[:, 32:]
    assert (found > 0).mean() > 0.99
    # SGBM's interpolation pulls towards whole pixels.
    assert np.abs(np.median(found) - disparity) < 0.2
    assert np.quantile(np.abs(found[found > 0] - disparity), 0.95) < 0.35


@pytest.mark.parametrize('mode', [0, 1, 2, 3])
@pytest.mark.parametrize(('count', 'lowest'), [(16, 0), (32, 0), (16, 5), (16, -4)])
def test_blind_left_border_has_no_disparity(count, lowest, mode):
    found = matched(shifted_pair(8), count, min_disparity_px=lowest, sgbm_mode=mode)
    border = lowest + count - 1
    assert (found[:, :border] == 0).all()
    assert_mostly(found[:, border + 1 : WIDTH - 5], 8)


@pytest.mark.parametrize('offset', [6.0, 2.5, -3.0])
def test_camera_offset_is_subtracted(offset):
    found = matched(shifted_pair(10), offset=offset)
    assert_mostly(found[:, 32:], 10 - offset)


def test_disparity_beyond_infinity_is_no_match():
    assert not matched(shifted_pair(5), offset=6.0).any()


def test_negative_shifts_can_be_searched():
    found = matched(shifted_pair(-4), min_disparity_px=-16, offset=-10.0)
    assert_mostly(found[:, 20:-20], 6)


def test_fixed_point_disparity_counts_sixteenths():
    fixed = semi_global_match(*shifted_pair(7), (2, 16), PENALTIES, StereoParameters())
    assert fixed.dtype == np.int16
    assert_mostly(fixed[:, 20:], 7 * SUBPIXELS, 1)
    assert (fixed[:, :2] == (2 - 1) * SUBPIXELS).all()


@pytest.mark.parametrize('search', [(0, 208), (-100, 208), (190, 16), (0, 4096)])
@pytest.mark.parametrize('mode', [0, 2])
def test_range_wider_than_the_image_matches_nothing(search, mode):
    parameters = StereoParameters(sgbm_mode=mode)
    fixed = semi_global_match(*shifted_pair(7), search, PENALTIES, parameters)
    assert fixed.shape == (HEIGHT, WIDTH)
    assert (fixed == (search[0] - 1) * SUBPIXELS).all()


def test_disparity_does_not_exceed_what_16_bits_hold():
    texture = np.random.default_rng(8).integers(0, 256, (20, 4400)).astype(np.uint8)
    texture = cv2.blur(texture, (3, 3))
    for disparity, found in ((2020, True), (2060, False)):
        pair = texture[:, :2300], texture[:, disparity : disparity + 2300]
        fixed = semi_global_match(*pair, (2000, 96), PENALTIES, StereoParameters())
        assert fixed.min() == 1999 * SUBPIXELS
        assert fixed.max() < 2048 * SUBPIXELS
        assert ((fixed == disparity * SUBPIXELS).sum() > 100) == found


@pytest.mark.parametrize('mode', [0, 1, 2, 3])
def test_every_mode_matches(mode):
    found = matched(shifted_pair(9), sgbm_mode=mode)
    assert_mostly(found[:, 32:], 9)


@pytest.mark.parametrize(
    ('p1', 'p2', 'expected'),
    [
        (0, 0, PENALTIES),
        (100, 0, Penalties(100, 1200)),
        (0, 900, Penalties(300, 900)),
        (100, 900, Penalties(100, 900)),
        (500, 400, Penalties(500, 501)),
        (99_000, 99_000, Penalties(15_999, 16_000)),
    ],
)
def test_penalties_of_the_user_replace_the_default(p1, p2, expected):
    assert chosen_penalties(StereoParameters(p1=p1, p2=p2), PENALTIES) == expected


@given(p1=st.integers(0, 100_000), p2=st.integers(0, 100_000))
def test_larger_change_costs_more_and_nothing_overflows(p1, p2):
    parameters = StereoParameters(p1=p1, p2=p2)
    found = chosen_penalties(parameters, PENALTIES)
    assert 0 < found.step < found.jump <= parameters.max_penalty


def test_range_follows_camera_and_nearest_distance():
    # 200 px * 0.1 m / 0.5 m = 40, and one more to interpolate: 41 fits into 48.
    assert disparity_range(camera(), 0.5) == 48
    assert disparity_range(camera(), 2.0) == 16
    assert disparity_range(camera(fx=400.0), 0.5) == 96
    assert disparity_range(camera(offset=10.0), 0.5) == 64
    assert disparity_range(camera(offset=-10.0), 0.5) == 48


@pytest.mark.parametrize('offset', [0.0, -10.0])
def test_range_has_one_disparity_more_than_the_nearest_distance_needs(offset):
    # fx B is 20 px m. A negative offset does not narrow the range.
    assert disparity_range(camera(offset), 20 / 14.5) == 16
    assert disparity_range(camera(offset), 20 / 15.5) == 32


@given(nearest=st.floats(0.01, 100), width=st.integers(32, 4000), share=st.floats(-0.5, 0.5))
def test_range_covers_the_nearest_distance_or_most_of_the_image(nearest, width, share):
    offset = share * width
    each = camera(offset, width)
    count = disparity_range(each, nearest)
    assert count % 16 == 0
    assert 16 <= count <= max(16, 0.8 * width)
    assert count > each.disparity_at(nearest) + offset or count > 0.8 * width - 16
