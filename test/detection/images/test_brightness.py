from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.images.brightness import (
    Spread,
    grey_level_shares,
    looked_up,
    spread_by_brightness,
)
from rover_obstacle_detection.detection.images.parameters import ImageParameters

PARAMETERS = ImageParameters()
SHAPE = (100, 120)


def halves(left, right):
    """An image with two brightnesses."""
    image = np.full(SHAPE, left, np.uint8)
    image[:, 60:] = right
    return image


def response(left, right, seed=1):
    """Normal values with a standard deviation in each half."""
    values = np.random.default_rng(seed).normal(0, 1, SHAPE)
    values[:, :60] *= left
    values[:, 60:] *= right
    return values.astype(np.float32)


def test_spread_is_measured_in_each_band_of_brightness():
    found = spread_by_brightness(response(3, 12), halves(20, 160), PARAMETERS)
    assert found.by_brightness.shape == (256,)
    assert found.by_brightness[20] == pytest.approx(3, rel=0.05)
    assert found.by_brightness[160] == pytest.approx(12, rel=0.05)
    assert 3 < found.overall < 12


def test_spread_between_bands_is_interpolated_and_beyond_them_constant():
    found = spread_by_brightness(response(3, 12), halves(20, 160), PARAMETERS).by_brightness
    # The middle of the rim, where windows see both halves, has bands of its own.
    assert (np.diff(found) >= -1).all()
    assert (found[:17] == found[0]).all()
    assert (found[200:] == found[255]).all()


def test_clipped_pixels_do_not_count():
    values = response(100, 5)
    for level in (0, 2, 253, 255):
        found = spread_by_brightness(values, halves(level, 100), PARAMETERS)
        assert found.by_brightness[100] == pytest.approx(5, rel=0.1)


@pytest.mark.parametrize('level', [0, 255])
def test_all_pixels_count_where_all_are_clipped(level):
    found = spread_by_brightness(response(4, 4), halves(level, level), PARAMETERS)
    assert found.overall == pytest.approx(4, rel=0.05)
    np.testing.assert_allclose(found.by_brightness, found.overall, rtol=1e-6)


def test_too_few_pixels_give_no_band():
    image, values = halves(100, 100), response(5, 5)
    image[:9, :5], values[:9, :5] = 20, 1000
    found = spread_by_brightness(values, image, PARAMETERS)
    np.testing.assert_allclose(found.by_brightness, 5, rtol=0.1)


def test_scaled_spread_is_no_smaller_than_the_least():
    found = Spread(3.0, np.array([1, 4, 10], np.float32)).scaled(0.5, 2.0)
    assert found.overall == 2.0
    np.testing.assert_array_equal(found.by_brightness, [2, 2, 5])


def test_local_brightness_chooses_the_value():
    levels = np.arange(256, dtype=np.float32) / 2
    found = looked_up(levels, halves(20, 160), PARAMETERS)
    assert found.dtype == np.float32
    assert (found[:, :56] == 10).all()
    assert (found[:, 64:] == 80).all()
    assert (np.diff(found[0, 54:66]) >= 0).all()


def test_shares_of_the_grey_levels():
    found = grey_level_shares(halves(20, 160), PARAMETERS)
    assert found[20] == found[160] == 0.5
    assert found.sum() == 1


def test_black_and_saturated_pixels_have_no_share_unless_almost_all_are():
    image = halves(0, 160)
    image[:50, :60] = 255
    found = grey_level_shares(image, PARAMETERS)
    assert found[160] == 1
    image[:, 60:118] = 0
    found = grey_level_shares(image, PARAMETERS)
    assert found[0] > 0.5
    assert found.sum() == pytest.approx(1)
