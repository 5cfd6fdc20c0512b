"""The faults of cameras that the tests of the detector rely on."""

from __future__ import annotations

from functools import partial

import cv2
import degrade
import numpy as np
import pytest

_RNG = np.random.default_rng(0)
LEFT, RIGHT = (
    cv2.GaussianBlur(_RNG.integers(0, 256, (60, 80)).astype(np.uint8), (0, 0), 1.0)
    for _ in range(2)
)

ONE_SIDED = (
    degrade.black,
    degrade.white,
    degrade.covered,
    degrade.half_covered,
    degrade.defocused,
    degrade.smudged,
    degrade.exposed,
    degrade.gamma,
    degrade.vignetted,
    degrade.compressed,
)


@pytest.mark.parametrize('change', ONE_SIDED, ids=lambda change: change.__name__)
def test_one_side_changes_and_the_other_stays(change):
    for side, changed, kept in (('left', 0, 1), ('right', 1, 0)):
        result = change(LEFT, RIGHT, side=side)
        np.testing.assert_array_equal(result[kept], (LEFT, RIGHT)[kept])
        assert (result[changed] != (LEFT, RIGHT)[changed]).any()
        assert result[changed].dtype == np.uint8
        assert result[changed].shape == LEFT.shape


def test_defocus_takes_the_detail_and_keeps_the_brightness():
    left, _ = degrade.defocused(LEFT, RIGHT, sigma_px=3.0)
    assert left.mean() == pytest.approx(LEFT.mean(), abs=1)
    assert left.std() < 0.5 * LEFT.std()


@pytest.mark.parametrize(('right_px', 'down_px'), [(4, 0), (-3, 0), (0, 5), (0, -2)])
def test_shifted_moves_what_the_right_image_shows(right_px, down_px):
    left, right = degrade.shifted(LEFT, RIGHT, right_px, down_px)
    np.testing.assert_array_equal(left, LEFT)
    moved = np.roll(RIGHT, (down_px, right_px), axis=(0, 1))
    inside = np.s_[6:-6, 6:-6]
    np.testing.assert_array_equal(right[inside], moved[inside])


def test_turned_moves_the_sides_in_opposite_directions():
    image = np.zeros((61, 81), np.uint8)
    image[28:33] = 200
    _, right = degrade.turned(image, image, angle_deg=5.0)
    rows = np.arange(61)
    first, last = ((rows @ right[:, x]) / right[:, x].sum() for x in (0, 80))
    expected = 40 * np.tan(np.radians(5))
    assert first - 30 == pytest.approx(expected, abs=0.2)
    assert last - 30 == pytest.approx(-expected, abs=0.2)


def test_exposure_scales_and_clips():
    left, right = degrade.exposed(LEFT, RIGHT, gain=3.0)
    assert (left[LEFT > 90] == 255).mean() > 0.95
    dark = RIGHT < 60
    assert right[dark].mean() == pytest.approx(3 * RIGHT[dark].mean(), abs=1)


def test_upside_down_twice_is_the_pair_itself():
    left, right = degrade.upside_down(*degrade.upside_down(LEFT, RIGHT))
    np.testing.assert_array_equal(left, LEFT)
    np.testing.assert_array_equal(right, RIGHT)


def test_same_twice_shows_the_left_camera_twice():
    same = degrade.same_twice(LEFT, RIGHT)
    np.testing.assert_array_equal(same[0], same[1])
    _, twin = degrade.same_twice(LEFT, RIGHT, noise=2.0)
    difference = twin.astype(float) - LEFT
    assert difference.std() == pytest.approx(2.0, abs=0.2)


def test_corners_lose_the_light_and_the_middle_keeps_it():
    pale = np.full((61, 81), 200, np.uint8)
    left, _ = degrade.vignetted(pale, pale, loss=0.7)
    assert left[30, 40] == 200
    assert left[0, 0] == pytest.approx(0.3 * 200, abs=1)


def test_a_covered_lens_shows_noise_that_differs_between_the_sides():
    left, right = degrade.covered(LEFT, RIGHT)
    assert left.std() < 5
    assert abs(np.corrcoef((left - left.mean()).ravel(), LEFT.ravel())[0, 1]) < 0.1
    assert (left != right).any()


def test_dirt_blurs_a_part_and_leaves_the_corners():
    blurred, _ = partial(degrade.smudged, radius=0.2)(LEFT, RIGHT)
    np.testing.assert_array_equal(blurred[:10, :10], LEFT[:10, :10])
    assert blurred[33:39, 41:47].std() < 0.5 * LEFT[33:39, 41:47].std()
