from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.standing import standing_parts
from rover_obstacle_detection.detection.terrain.terrain import Terrain

SHAPE = (20, 40)
ROCK = (slice(4, 12), slice(5, 15), 0.3)
PARAMETERS = RockParameters(max_step_m=0.1)


def raised(*blocks):
    """Flat ground with blocks (rows, columns, height)."""
    height = np.zeros(SHAPE, np.float32)
    for rows, columns, height_m in blocks:
        height[rows, columns] = height_m
    return height


def standing(height_m, noise_m=0.001, parameters=PARAMETERS):
    height_m = np.asarray(height_m, np.float32)
    noise = np.broadcast_to(np.float32(noise_m), height_m.shape)
    terrain = Terrain(height_m, noise, np.ones_like(noise), np.full_like(height_m, 200), ())
    found = standing_parts(terrain, parameters)
    assert found.parts.dtype == np.int32
    assert found.top_m.dtype == np.float32
    assert found.top_m[0] == 0
    assert found.parts.max() < len(found.top_m)
    return found


def test_rock_stands_with_its_height():
    found = standing(raised(ROCK))
    np.testing.assert_array_equal(found.parts > 0, raised(ROCK) > 0)
    assert found.top_m[found.parts[5, 6]] == pytest.approx(0.3, abs=1e-6)


def test_low_pixels_belong_to_the_rock_that_they_touch():
    skirt = (slice(2, 14), slice(3, 17), 0.03)
    bump = (slice(4, 12), slice(25, 35), 0.03)
    found = standing(raised(skirt, bump, ROCK))
    expected = np.zeros(SHAPE, bool)
    expected[2:14, 3:17] = True
    np.testing.assert_array_equal(found.parts > 0, expected)


@pytest.mark.parametrize(('height', 'stands'), [(0.055, False), (0.065, True)])
def test_rock_needs_a_good_part_of_the_step(height, stands):
    assert standing(raised((*ROCK[:2], height))).parts.any() == stands


def test_step_of_a_larger_rover_hides_the_rock():
    found = standing(raised(ROCK), parameters=RockParameters(max_step_m=0.6))
    assert not found.parts.any()
    assert not found.top_m.any()


@pytest.mark.parametrize(('noise', 'stands'), [(0.1, True), (0.13, False), (np.inf, False)])
def test_rock_needs_to_rise_above_the_noise(noise, stands):
    assert standing(raised(ROCK), noise).parts.any() == stands


def test_low_pixels_within_the_noise_are_ground():
    skirt = (slice(2, 14), slice(3, 17), 0.06)
    found = standing(raised(skirt, ROCK), 0.07)
    np.testing.assert_array_equal(found.parts > 0, raised(ROCK) > 0)


def test_noise_of_each_pixel_counts():
    noise = np.full(SHAPE, 0.001)
    noise[:, 20:] = 0.2
    other = (slice(4, 12), slice(25, 35), 0.3)
    found = standing(raised(ROCK, other), noise)
    np.testing.assert_array_equal(found.parts > 0, raised(ROCK) > 0)


@pytest.mark.parametrize(('size', 'stands'), [(1, False), (3, True)])
def test_single_pixels_are_no_rock(size, stands):
    height = raised((slice(4, 4 + size), slice(5, 5 + size), 0.25))
    assert standing(height).parts.any() == stands


@pytest.mark.parametrize(('columns', 'stands'), [(4, False), (5, True)])
def test_rock_needs_three_pixels_that_stay_high_when_blurred(columns, stands):
    assert standing(raised((slice(4, 7), slice(5, 5 + columns), 0.08))).parts.any() == stands
    assert standing(raised((slice(4, 4 + columns), slice(5, 8), 0.08))).parts.any() == stands


def test_separate_rocks_have_their_own_height():
    second = (slice(4, 12), slice(25, 35), 0.5)
    found = standing(raised(ROCK, second))
    one, other = found.parts[6, 8], found.parts[6, 30]
    assert one != other
    assert found.top_m[one] == pytest.approx(0.3, abs=1e-6)
    assert found.top_m[other] == pytest.approx(0.5, abs=1e-6)


def test_height_of_a_rock_is_that_of_its_highest_tenth():
    height = raised(ROCK)
    height[4:12, 5:9] = 0.6
    found = standing(height)
    assert found.top_m[found.parts[6, 6]] == pytest.approx(0.6, abs=1e-6)


def test_unknown_heights_do_not_stand():
    height = raised(ROCK)
    height[6, 8] = np.nan
    height[:, 30:] = np.nan
    found = standing(height)
    assert found.parts[6, 8] == 0
    assert not found.parts[:, 30:].any()
    assert np.isfinite(found.top_m).all()


@pytest.mark.parametrize('height', [0.0, -0.5, np.nan])
def test_nothing_stands_on_flat_ground(height):
    found = standing(np.full(SHAPE, height))
    assert not found.parts.any()
    assert not found.top_m.any()
