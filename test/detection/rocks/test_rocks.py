from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.rocks.rocks import (
    BLOCK,
    MARGIN_BLOCKS,
    denied_parts,
    too_high,
    upright_parts,
    windows_around,
)
from rover_obstacle_detection.detection.terrain.hazards import Standing
from rover_obstacle_detection.detection.terrain.survey import Terrain

SHAPE = (60, 80)
ROCK = np.s_[20:36, 30:50]
CONFIG = DetectorConfig(max_step=0.1)


def terrain_of(height_m=0.0, noise_m=0.005, step_px=30.0, measured=True):
    height = np.zeros(SHAPE, np.float32)
    height[ROCK] = height_m
    height[ROCK] = np.where(measured, height[ROCK], np.nan)
    return Terrain(
        height,
        np.full(SHAPE, noise_m, np.float32),
        np.ones(SHAPE, np.float32),
        np.full(SHAPE, step_px / CONFIG.max_step, np.float32),
        (),
    )


def kept(terrain, probability=0.6, drawn=ROCK, unmeasured=False):
    """What is kept of a drawing, all or nothing: 'high', 'by sight' or ''."""
    mask = np.zeros(SHAPE, bool)
    mask[drawn] = True
    high, by_sight = too_high(
        mask,
        np.full(SHAPE, probability, np.float32),
        terrain,
        ~terrain.measured & unmeasured,
        CONFIG,
    )
    for rocks in (high, by_sight):
        assert rocks.dtype == np.bool_
        assert rocks.sum() in (0, mask.sum())
    assert not (high & by_sight).any()
    return 'high' if high.any() else 'by sight' if by_sight.any() else ''


@pytest.mark.parametrize(('height', 'expected'), [(0.05, ''), (0.095, ''), (0.11, 'high')])
def test_near_it_takes_the_whole_step(height, expected):
    assert kept(terrain_of(height), 0.99) == expected


@pytest.mark.parametrize(('height', 'expected'), [(0.06, ''), (0.08, 'high')])
def test_far_blocks_flatten_and_less_is_asked(height, expected):
    assert kept(terrain_of(height, step_px=12.0)) == expected


def test_height_must_be_over_the_noise():
    assert kept(terrain_of(0.15, noise_m=0.15))
    assert not kept(terrain_of(0.15, noise_m=0.3))


@pytest.mark.parametrize(
    ('step_px', 'probability', 'measured', 'expected'),
    [
        (5.0, 0.9, True, 'high'),
        (5.0, 0.6, True, ''),
        (15.0, 0.9, True, ''),
        (5.0, 0.9, False, ''),
    ],
    ids=['sure and far', 'unsure', 'near', 'no 3D'],
)
def test_far_away_what_surely_looks_like_a_rock_is_one(step_px, probability, measured, expected):
    terrain = terrain_of(0.03, noise_m=0.1, step_px=step_px, measured=measured)
    assert kept(terrain, probability) == expected


def test_far_away_stereo_may_rule_out_what_looks_like_a_rock():
    assert kept(terrain_of(0.01, noise_m=0.03, step_px=5.0), 0.9) == 'high'
    assert kept(terrain_of(0.01, noise_m=0.015, step_px=5.0), 0.9) == ''


def test_far_away_it_has_to_look_as_large_as_the_step():
    terrain = terrain_of(0.03, noise_m=0.1, step_px=8.0)
    assert kept(terrain, 0.9)
    assert not kept(terrain, 0.9, drawn=np.s_[22:28, 30:50])


@pytest.mark.parametrize(
    ('step_px', 'probability', 'in_range', 'expected'),
    [
        (12.0, 0.9, True, 'by sight'),
        (12.0, 0.6, True, ''),
        (20.0, 0.9, True, ''),
        (12.0, 0.9, False, ''),
    ],
    ids=['sure and large', 'unsure', 'small', 'out of range'],
)
def test_without_3d_looks_and_size_decide(step_px, probability, in_range, expected):
    terrain = terrain_of(0.0, step_px=step_px, measured=False)
    assert kept(terrain, probability, unmeasured=in_range) == expected


def test_what_looks_high_where_there_is_no_3d_is_ruled_out_by_flat_ground_in_its_midst():
    terrain = terrain_of(0.0, noise_m=0.005, step_px=12.0)
    terrain.height_m[20:30, 30:50] = np.nan
    assert kept(terrain, 0.9, unmeasured=True) == ''
    terrain.height_m[30:36, 30:50] = 0.3
    assert kept(terrain, 0.9, unmeasured=True) != ''


def test_a_core_does_not_make_an_obstacle_of_what_lies_flat():
    terrain = terrain_of(0.0)
    terrain.height_m[20:23, 30:50] = 0.3
    assert not kept(terrain)
    terrain.height_m[20:27, 30:50] = 0.3
    assert kept(terrain)


def legged(height_m, noise_m=0.005):
    terrain = terrain_of(0.0, noise_m)
    terrain.height_m[10:50, 40:46] = height_m
    parts = (terrain.height_m > 0.02).astype(np.int32)
    standing = Standing(parts, np.array([0, height_m], np.float32))
    return denied_parts(np.zeros(SHAPE, bool), terrain, standing, CONFIG)


def test_what_stands_far_over_step_and_noise_may_not_be_denied():
    assert legged(0.3)[12:48, 41:45].all()
    assert not legged(0.12).any()
    assert not legged(0.3, noise_m=0.05).any()


def test_only_what_is_clearly_higher_than_wide_is_upright():
    mask = np.zeros(SHAPE, bool)
    mask[5:25, 5:15] = True
    mask[5:15, 30:60] = True
    found = upright_parts(mask)
    assert found[5:25, 5:15].all()
    assert not found[:, 30:].any()


@given(
    st.tuples(st.integers(1, 150), st.integers(1, 150)),
    st.lists(st.tuples(st.integers(0, 149), st.integers(0, 149)), min_size=1, max_size=6),
)
def test_windows_hold_every_pixel_with_its_margin(shape, places):
    where = np.zeros(shape, bool)
    for row, column in places:
        where[row % shape[0], column % shape[1]] = True
    windows = windows_around(where)
    margin = BLOCK * (MARGIN_BLOCKS - 1) + 1
    for row, column in np.argwhere(where):
        assert any(
            rows.start <= max(row - margin, 0)
            and rows.stop >= min(row + margin, shape[0])
            and columns.start <= max(column - margin, 0)
            and columns.stop >= min(column + margin, shape[1])
            for rows, columns in windows
        )
    for window in windows:
        assert where[window].any()
        assert window[0].start % BLOCK == window[1].start % BLOCK == 0


def test_what_lies_apart_has_windows_of_its_own_and_what_fills_the_image_one():
    where = np.zeros((400, 400), bool)
    where[10, 10] = where[390, 390] = True
    windows = windows_around(where)
    assert len(windows) == 2
    assert sum(where[window].size for window in windows) < 0.1 * where.size
    where[::30, ::30] = True
    assert windows_around(where) == [(slice(0, 400), slice(0, 400))]
