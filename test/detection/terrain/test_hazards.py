from __future__ import annotations

import math

import numpy as np
import pytest
from relief import Eye, bank, block, flat, tilted, together

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.elevation_map import map_positions
from rover_obstacle_detection.detection.terrain.hazards import (
    impassable_ground,
    rough_ground,
    standing_parts,
)
from rover_obstacle_detection.detection.terrain.survey import Layer, Terrain

SHAPE = (20, 40)
CONFIG = DetectorConfig(max_step=0.1)
EYE = Eye(pitch_deg=40.0, height_m=1.5)


def terrain(height_m, noise_m=0.001):
    height_m = np.asarray(height_m, np.float32)
    noise = np.broadcast_to(np.float32(noise_m), height_m.shape)
    return Terrain(height_m, noise, np.ones_like(noise), np.full_like(height_m, 200), ())


def raised(*parts):
    """Flat ground with rectangles (rows, columns, height)."""
    height = np.zeros(SHAPE, np.float32)
    for rows, columns, height_m in parts:
        height[rows, columns] = height_m
    return height


ROCK = (slice(4, 12), slice(5, 15), 0.3)


def standing(height_m, noise_m=0.001, config=CONFIG):
    found = standing_parts(terrain(height_m, noise_m), config)
    assert found.parts.dtype == np.int32
    assert found.top_m.dtype == np.float32
    assert found.top_m[0] == 0
    assert found.parts.max() < len(found.top_m)
    return found


def test_rock_stands():
    found = standing(raised(ROCK))
    np.testing.assert_array_equal(found.parts > 0, raised(ROCK) > 0)
    number = found.parts[5, 6]
    assert found.top_m[number] == pytest.approx(0.3, abs=1e-6)


def test_foot_is_kept_where_it_goes_with_something_high():
    skirt = (slice(2, 14), slice(3, 17), 0.03)
    bump = (slice(4, 12), slice(25, 35), 0.03)
    found = standing(raised(skirt, bump, ROCK))
    expected = np.zeros(SHAPE, bool)
    expected[2:14, 3:17] = True
    np.testing.assert_array_equal(found.parts > 0, expected)


@pytest.mark.parametrize(('height', 'stands'), [(0.055, False), (0.065, True)])
def test_well_under_a_step_nothing_stands(height, stands):
    assert standing(raised((*ROCK[:2], height))).parts.any() == stands


def test_step_is_the_rovers():
    found = standing(raised(ROCK), config=DetectorConfig(max_step=0.6))
    assert not found.parts.any()
    assert not found.top_m.any()


@pytest.mark.parametrize(('noise', 'stands'), [(0.1, True), (0.13, False), (np.inf, False)])
def test_noise_that_could_be_it_stands_for_nothing(noise, stands):
    assert standing(raised(ROCK), noise).parts.any() == stands


def test_noise_that_could_be_the_foot_is_left_out():
    skirt = (slice(2, 14), slice(3, 17), 0.06)
    found = standing(raised(skirt, ROCK), 0.07)
    np.testing.assert_array_equal(found.parts > 0, raised(ROCK) > 0)


def test_noise_counts_where_it_is():
    noise = np.full(SHAPE, 0.001)
    noise[:, 20:] = 0.2
    other = (slice(4, 12), slice(25, 35), 0.3)
    found = standing(raised(ROCK, other), noise)
    np.testing.assert_array_equal(found.parts > 0, raised(ROCK) > 0)


@pytest.mark.parametrize(('size', 'stands'), [(1, False), (3, True)])
def test_single_pixels_are_no_rock(size, stands):
    height = raised((slice(4, 4 + size), slice(5, 5 + size), 0.25))
    assert standing(height).parts.any() == stands


def test_parts_are_told_apart_and_each_has_its_height():
    second = (slice(4, 12), slice(25, 35), 0.5)
    found = standing(raised(ROCK, second))
    one, other = found.parts[6, 8], found.parts[6, 30]
    assert one != other
    assert found.top_m[one] == pytest.approx(0.3, abs=1e-6)
    assert found.top_m[other] == pytest.approx(0.5, abs=1e-6)


def test_top_is_that_of_the_highest_tenth():
    height = raised(ROCK)
    height[4:12, 5:9] = 0.6
    found = standing(height)
    assert found.top_m[found.parts[6, 6]] == pytest.approx(0.6, abs=1e-6)


def test_unknown_heights_stand_for_nothing():
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


def impassable(height, eye=EYE, ground=None, noise_px=0.02, **config):
    ground = ground or eye.level_ground
    found, _, x, y = eye.survey(height, noise_px, ground, **config)
    steep, dropped = impassable_ground(found, ground, DetectorConfig(**config))
    for flags in (steep, dropped):
        assert flags.dtype == np.bool_
        assert flags.shape == eye.camera.shape
        assert not flags[~found.measured].any()
    return steep, dropped, np.where(found.measured, x, np.nan), np.where(found.measured, y, np.nan)


@pytest.mark.parametrize('limit', [2, 5, 20])
def test_limit_of_the_slope_may_be_small(limit):
    steep, _, _, y = impassable(bank(26, 0.0), max_slope=limit)
    assert steep[(y > 0.8) & (y < 1.6)].mean() > 0.9


def test_flat_ground_is_neither_steep_nor_dropped():
    steep, dropped, *_ = impassable(flat)
    assert not steep.any()
    assert not dropped.any()


@pytest.mark.parametrize(('angle', 'flagged'), [(26, 1), (22, 1), (18, 0), (12, 0)])
@pytest.mark.parametrize('sign', [1, -1], ids=['up', 'down'])
def test_slope_ahead_is_impassable_where_it_is_too_steep(angle, flagged, sign):
    steep, _, _, y = impassable(bank(sign * angle, 2.0))
    assert steep[(y > 2.5) & (y < 5)].mean() == pytest.approx(flagged, abs=0.05)
    assert not steep[(y > 0.2) & (y < 1.6)].any()


@pytest.mark.parametrize(('angle', 'flagged'), [(26, 1), (-26, 1), (12, 0), (-12, 0)])
def test_slope_to_the_side(angle, flagged):
    steep, _, _, y = impassable(tilted(rise_x=math.tan(math.radians(angle))))
    assert steep[y < 4].mean() == pytest.approx(flagged, abs=0.05)


@pytest.mark.parametrize(('limit', 'flagged'), [(10.0, 1), (30.0, 0)])
def test_limit_of_the_slope_is_the_rovers(limit, flagged):
    steep, _, _, y = impassable(bank(20, 2.0), max_slope=limit)
    assert steep[(y > 2.5) & (y < 5)].mean() == pytest.approx(flagged, abs=0.05)


def test_slope_counts_against_the_vertical_and_not_against_the_plane():
    up = Gravity.from_angles(EYE.pitch_deg - 12).up
    ground = GroundPlane(EYE.up, EYE.height_m, up)
    # With that vertical what the eye has for level rises by 12 degrees ahead.
    assert ground.slope_deg == pytest.approx(12)
    for angle, flagged in ((12, 1), (5, 0), (-26, 0)):
        steep, _, _, y = impassable(bank(angle, 2.0), ground=ground)
        assert steep[(y > 2.5) & (y < 5)].mean() == pytest.approx(flagged, abs=0.05)


def test_rocks_are_no_slopes():
    steep, dropped, *_ = impassable(together(block(0, 2, 0.4, 0.3), block(0.8, 3, 0.5, 0.4)))
    assert steep.mean() < 0.005
    assert not dropped.any()


@pytest.mark.parametrize(('depth', 'found'), [(0.3, 1), (0.08, 0)])
def test_pit_is_dropped(depth, found):
    _, dropped, x, y = impassable(block(0.0, 2.0, 0.8, -depth))
    inner = np.maximum(abs(x), abs(y - 2)) < 0.35
    assert np.count_nonzero(inner) > 100
    assert dropped[inner].mean() == pytest.approx(found, abs=0.1)
    assert not dropped[np.maximum(abs(x), abs(y - 2)) > 0.5].any()


def test_pit_may_be_as_deep_as_the_rovers_step():
    _, dropped, *_ = impassable(block(0.0, 2.0, 0.8, -0.3), max_step=0.4)
    assert not dropped.any()


@pytest.mark.parametrize('height', [bank(26, 2.0), block(0.0, 2.0, 0.8, -0.3)])
def test_noise_that_hides_a_step_hides_slopes_and_drops(height):
    quiet = np.logical_or(*impassable(height)[:2])
    assert quiet.any()
    noisy = np.logical_or(*impassable(height, noise_px=2.0)[:2])
    assert not noisy.any()


def test_pit_must_be_deeper_than_noise():
    # Half as deep again as the rover can step, and 2 noises are more than that half.
    pit = block(0.0, 2.0, 0.8, -0.15)
    assert impassable(pit)[1].any()
    assert not impassable(pit, noise_px=0.4)[1].any()


def rough(heights_m, *, noise_m=0.001, rocks=None, **config):
    height_m = np.asarray(heights_m, np.float32)
    across, along = np.meshgrid(np.arange(height_m.shape[1]), np.arange(height_m.shape[0]))
    positions = map_positions(
        across.astype(np.float32) * 0.01,
        along.astype(np.float32) * 0.01,
        np.ones(height_m.shape, bool),
        0.04,
    )
    level = np.zeros(positions.shape, np.float32)
    layer = Layer(
        slice(0, len(height_m)),
        positions,
        mean_m=level,
        information=level + 1,
        noise_m=level,
        is_ground=np.ones(positions.shape, bool),
        ground_m=level,
        seen=np.ones(positions.shape, bool),
        eye_m=level + 1,
        pixels=np.ones(height_m.shape, bool),
    )
    terrain = Terrain(
        height_m,
        np.full(height_m.shape, noise_m, np.float32),
        np.ones_like(height_m),
        np.full(height_m.shape, 100, np.float32),
        (layer,),
    )
    rocks = np.zeros(height_m.shape, bool) if rocks is None else rocks
    return rough_ground(terrain, rocks, DetectorConfig(**config))


def test_ground_full_of_stones_is_rough_and_a_single_one_does_not_make_it_so():
    stones = np.zeros((200, 200))
    stones[:, 100:] = np.where(np.indices((200, 100)).sum(0) % 2, 0.09, -0.03)
    found = rough(stones, max_roughness=0.05)
    assert found[:, 150:].all()
    assert not found[:, :50].any()
    one = np.zeros((200, 200))
    one[100:104, 100:104] = 5.0
    assert not rough(one, max_roughness=0.05).any()


def test_roughness_is_the_rovers_limit_and_neither_noise_nor_obstacles_make_it():
    stones = np.where(np.indices((200, 200)).sum(0) % 2, 0.07, -0.05)
    assert rough(stones, max_roughness=0.05).all()
    assert not rough(stones).any()
    assert not rough(stones, max_roughness=0.08).any()
    assert not rough(stones, max_roughness=0.05, noise_m=0.06).any()
    assert not rough(stones, max_roughness=0.05, rocks=np.ones((200, 200), bool)).any()
