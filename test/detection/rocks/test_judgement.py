from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.detection.rocks.judgement import (
    half_height_outlines,
    overruled_parts,
    too_high,
    upright_parts,
)
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.standing import Standing
from rover_obstacle_detection.detection.terrain.terrain import Terrain

SHAPE = (60, 80)
ROCK = np.s_[20:36, 30:50]
PARAMETERS = RockParameters(max_step_m=0.1)


def terrain_of(height_m=0.0, noise_m=0.005, step_px=30.0, measured=True):
    height = np.zeros(SHAPE, np.float32)
    height[ROCK] = height_m
    height[ROCK] = np.where(measured, height[ROCK], np.nan)
    return Terrain(
        height,
        np.full(SHAPE, noise_m, np.float32),
        np.ones(SHAPE, np.float32),
        np.full(SHAPE, step_px / PARAMETERS.max_step_m, np.float32),
        (),
    )


def kept(terrain, probability=0.6, drawn=ROCK, parameters=PARAMETERS):
    """Whether a drawn rock is kept; it is as a whole or not at all."""
    mask = np.zeros(SHAPE, bool)
    mask[drawn] = True
    high = too_high(mask, np.full(SHAPE, probability, np.float32), terrain, parameters)
    assert high.dtype == np.bool_
    assert high.sum() in (0, mask.sum())
    return high.any()


@pytest.mark.parametrize(('height', 'expected'), [(0.05, False), (0.095, False), (0.11, True)])
def test_near_rock_has_to_be_as_high_as_the_step(height, expected):
    assert kept(terrain_of(height), 0.99) == expected


@pytest.mark.parametrize(('height', 'expected'), [(0.06, False), (0.08, True)])
def test_small_rock_may_be_lower_since_matching_flattens_it(height, expected):
    assert kept(terrain_of(height, step_px=12.0)) == expected


def test_rock_has_to_rise_above_its_noise():
    assert kept(terrain_of(0.15, noise_m=0.15))
    assert not kept(terrain_of(0.15, noise_m=0.3))


def test_noise_need_not_count_even_where_there_is_no_3d():
    terrain = terrain_of(0.15, noise_m=0.3)
    terrain.noise_m[30:] = np.inf
    assert kept(terrain, parameters=replace(PARAMETERS, core_noises=0.0))


@pytest.mark.parametrize(
    ('step_px', 'probability', 'measured', 'expected'),
    [
        (5.0, 0.9, True, True),
        (5.0, 0.6, True, False),
        (15.0, 0.9, True, False),
        (5.0, 0.9, False, False),
    ],
    ids=['likely and far', 'unlikely', 'near', 'without 3D'],
)
def test_far_rock_is_accepted_by_its_looks(step_px, probability, measured, expected):
    terrain = terrain_of(0.03, noise_m=0.1, step_px=step_px, measured=measured)
    assert kept(terrain, probability) == expected


def test_stereo_can_rule_out_a_far_rock():
    assert kept(terrain_of(0.01, noise_m=0.03, step_px=5.0), 0.9)
    assert not kept(terrain_of(0.01, noise_m=0.015, step_px=5.0), 0.9)


def test_far_rock_has_to_look_as_large_as_the_step():
    terrain = terrain_of(0.03, noise_m=0.1, step_px=8.0)
    assert kept(terrain, 0.9)
    assert not kept(terrain, 0.9, drawn=np.s_[22:28, 30:50])


@pytest.mark.parametrize('step_px', [5.0, 12.0, 20.0])
def test_looks_alone_make_no_rock(step_px):
    assert not kept(terrain_of(0.0, step_px=step_px, measured=False), 0.99)


@pytest.mark.parametrize(('measured_rows', 'expected'), [(1, False), (2, True)])
def test_a_rock_may_be_mostly_in_shadow(measured_rows, expected):
    # Of 16 rows; one in eight must be measured.
    terrain = terrain_of(0.0)
    terrain.height_m[20 : 36 - measured_rows, 30:50] = np.nan
    terrain.height_m[36 - measured_rows : 36, 30:50] = 0.3
    assert kept(terrain, 0.9) == expected


def test_the_step_is_as_large_in_the_image_as_where_the_rock_is_measured():
    # Pixels without 3D have no scale; they must not make the rock seem far away.
    terrain = terrain_of(0.03, noise_m=0.1, step_px=15.0)
    terrain.height_m[20:30, 30:50] = np.nan
    terrain.pixels_per_metre[20:30, 30:50] = 0
    assert not kept(terrain, 0.9)
    terrain.pixels_per_metre[30:36, 30:50] = 5.0 / PARAMETERS.max_step_m
    assert kept(terrain, 0.9)


def test_core_needs_a_rock_that_mostly_stands_up():
    terrain = terrain_of(0.0)
    terrain.height_m[20:23, 30:50] = 0.3
    assert not kept(terrain)
    terrain.height_m[20:27, 30:50] = 0.3
    assert kept(terrain)


@pytest.mark.parametrize(('pixels', 'expected'), [(3, True), (4, False)])
def test_core_has_at_least_so_many_smoothed_pixels(pixels, expected):
    # Blurred over 3 x 3 pixels, only the middle of the 3 x 5 block stays as high as the step.
    terrain = terrain_of(0.05)
    terrain.height_m[25:28, 36:41] = 0.12
    assert kept(terrain, parameters=replace(PARAMETERS, min_core_pixels=pixels)) == expected


@pytest.mark.parametrize(('share', 'expected'), [(0.25, True), (0.26, False)])
def test_share_of_a_rock_that_stands_up(share, expected):
    # Blurred, it stands up in 4 of 16 rows.
    terrain = terrain_of(0.0)
    terrain.height_m[20:23, 30:50] = 0.3
    terrain.height_m[:20] = terrain.height_m[:, :30] = terrain.height_m[:, 50:] = np.nan
    assert kept(terrain, parameters=replace(PARAMETERS, standing_share=share)) == expected


@pytest.mark.parametrize(('share', 'expected'), [(0.125, True), (0.13, False)])
def test_share_of_a_rock_that_is_measured(share, expected):
    terrain = terrain_of(0.3)
    terrain.height_m[20:34, 30:50] = np.nan
    assert kept(terrain, parameters=replace(PARAMETERS, min_measured_share=share)) == expected


AT_THE_LIMITS = RockParameters(
    max_step_m=0.125, small_step_px=20.0, accepted_probability=0.75, possible_share=0.25
)


@pytest.mark.parametrize(
    ('changes', 'expected'),
    [
        ({}, True),
        ({'small_step_px': 16.0}, False),
        ({'accepted_probability': 0.76}, False),
        ({'possible_share': 0.26}, False),
        ({'max_step_m': 0.126}, False),
    ],
    ids=str,
)
def test_far_rock_at_each_limit(changes, expected):
    # The step and the rock are 16 px high, and stereo allows for a rock in 4 of its rows.
    terrain = terrain_of(0.03)
    terrain.pixels_per_metre[:] = 16 / 0.125
    terrain.noise_m[20:24] = 0.1
    assert kept(terrain, 0.75, parameters=replace(AT_THE_LIMITS, **changes)) == expected


def test_far_rock_may_be_a_single_pixel():
    assert kept(terrain_of(0.03, noise_m=0.1, step_px=1.0), 0.9, drawn=np.s_[25:26, 35:36])


def leg(height_m):
    """A lander's leg, much higher than wide in the image, on flat ground."""
    terrain = terrain_of(0.0)
    terrain.height_m[10:50, 40:46] = height_m
    standing = Standing(
        (terrain.height_m > 0.02).astype(np.int32), np.array([0, height_m], np.float32)
    )
    return terrain, standing


def overruled(terrain, standing, drawn=(), **changes):
    mask = np.zeros(SHAPE, bool)
    for part in drawn:
        mask[part] = True
    return overruled_parts(mask, terrain, standing, replace(PARAMETERS, **changes))


def test_network_is_overruled_where_height_is_certain():
    assert overruled(*leg(0.3))[12:48, 41:45].all()


def test_network_is_not_overruled_near_the_step():
    assert not overruled(*leg(0.12)).any()


def test_network_is_not_overruled_where_height_is_noisy():
    terrain, standing = leg(0.3)
    terrain.noise_m[:] = 0.05
    assert not overruled(terrain, standing).any()


def test_network_is_not_overruled_where_it_outlined_the_part():
    assert not overruled(*leg(0.3), drawn=[np.s_[10:50, 40:46]]).any()
    half = [np.s_[10:30, 40:46]]
    assert overruled(*leg(0.3), drawn=half).any()
    assert overruled(*leg(0.3), drawn=half, drawn_share=0.51).any()
    assert not overruled(*leg(0.3), drawn=half, drawn_share=0.5).any()


def test_height_is_certain_from_so_many_pixels():
    # The leg has 40 x 6 of them.
    assert overruled(*leg(0.3), certain_pixels=240).any()
    assert not overruled(*leg(0.3), certain_pixels=241).any()


def test_network_is_not_overruled_for_what_is_wider_than_high():
    terrain = terrain_of(0.3)
    standing = Standing((terrain.height_m > 0.02).astype(np.int32), np.array([0, 0.3], np.float32))
    assert not overruled(terrain, standing).any()


@pytest.mark.parametrize(('ratio', 'upright'), [(1.5, True), (2.0, True), (2.5, False)])
def test_upright_parts_are_higher_than_wide_by_the_ratio(ratio, upright):
    mask = np.zeros(SHAPE, bool)
    mask[5:25, 5:15] = True
    mask[5:15, 30:60] = True
    found = upright_parts(mask, ratio)
    assert found[5:25, 5:15].all() == found.any() == upright
    assert not found[:, 30:].any()


def test_half_height_outline_cuts_off_blurred_rims_but_not_the_foot():
    terrain, standing = leg(0.3)
    terrain.height_m[7:10, 40:46] = terrain.height_m[10:50, 46:49] = 0.1
    terrain.height_m[50:53, 40:46] = 0.1
    parts = np.zeros(SHAPE, np.int32)
    parts[7:53, 40:49] = 1
    found = half_height_outlines(terrain, Standing(parts, standing.top_m), reach_px=5)
    expected = np.zeros(SHAPE, bool)
    expected[10:53, 40:46] = True
    np.testing.assert_array_equal(found, expected)


def test_half_height_outline_reaches_only_so_far_beside_a_part():
    terrain, _ = leg(0.3)
    terrain.height_m[10:50, 46:60] = 0.1
    everywhere = Standing(np.ones(SHAPE, np.int32), np.array([0, 0.3], np.float32))
    found = half_height_outlines(terrain, everywhere, reach_px=5)
    assert not found[10:50, 46:51].any()
    assert found[10:50, 51:60].all()


def test_half_height_outline_is_that_of_the_parts_and_needs_no_3d_beside_them():
    terrain, standing = leg(0.3)
    terrain.height_m[10:50, 36:40] = np.nan
    parts = np.where(np.arange(SHAPE[0])[:, np.newaxis] < 30, standing.parts, 0)
    found = half_height_outlines(terrain, Standing(parts, standing.top_m), reach_px=5)
    np.testing.assert_array_equal(found, parts > 0)
