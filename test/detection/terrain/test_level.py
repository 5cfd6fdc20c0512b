from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS, terrain_of

from rover_obstacle_detection.detection.terrain.level import (
    level_ground,
    uneven,
)


def test_height_is_known_where_a_step_would_show():
    height_m = np.array([0, 0, 0, np.nan, 0], np.float32)
    noise_m = np.array([0.001, 0.049, 0.051, 0.001, np.inf], np.float32)
    terrain = terrain_of(height_m, noise_m)
    assert level_ground(terrain, PARAMETERS).tolist() == [True, True, False, False, False]
    higher = replace(PARAMETERS, max_step_m=0.2)
    assert level_ground(terrain, higher).tolist() == [True, True, True, False, False]


def test_what_is_measured_beyond_a_step_is_not_known_to_be_level():
    height_m = np.array([0, 0.099, -0.099, 0.105, 0.2, -0.2, 0.12, 0.12, np.nan], np.float32)
    noise_m = np.array([0, 0, 0, 0.002, 0.002, 0.002, 0.006, 0.007, 0.001], np.float32)
    found = level_ground(terrain_of(height_m, noise_m), PARAMETERS)
    assert found.tolist() == [True, True, True, True, False, False, False, True, False]
    higher = replace(PARAMETERS, max_step_m=0.21)
    assert level_ground(terrain_of(height_m, noise_m), higher)[:-1].all()


def uneven_columns(heights_m, *, noise_m=0.0, obstacles=(), across=True, **parameters):
    """Columns of ground with a height for each that are uneven; rows if not across."""
    height_m = np.tile(np.asarray(heights_m, np.float32), (41, 1))
    obstacle = np.zeros(height_m.shape, bool)
    obstacle[:, list(obstacles)] = True
    if not across:
        height_m, obstacle = height_m.T, obstacle.T
    terrain = terrain_of(np.ascontiguousarray(height_m), noise_m)
    found = uneven(terrain, obstacle, replace(PARAMETERS, **parameters))
    return np.flatnonzero(found[20] if across else found[:, 20]).tolist()


def step(height_m, base_m=0.0):
    return [base_m] * 20 + [base_m + height_m] * 20


@pytest.mark.parametrize('across', [True, False], ids=['columns', 'rows'])
@pytest.mark.parametrize('sign', [1, -1], ids=['up', 'down'])
def test_ground_is_uneven_where_a_step_is_within_the_window(sign, across):
    assert uneven_columns(step(sign * 0.05), across=across) == list(range(16, 24))
    assert uneven_columns(step(sign * 0.02), across=across) == []
    assert uneven_columns(step(sign * 0.05), across=across, max_step_m=0.25) == []
    wide = uneven_columns(step(sign * 0.05), across=across, relief_window_px=17)
    assert wide == list(range(12, 28))


def test_what_noise_explains_is_not_uneven():
    assert uneven_columns(step(0.04), noise_m=0.005) != []
    assert uneven_columns(step(0.04), noise_m=0.02) == []


def test_obstacles_do_not_make_the_ground_beside_them_uneven():
    ground = [0.09] * 20 + [0.5] * 8 + [0.09] * 12
    found = uneven_columns(ground, obstacles=range(20, 28))
    assert set(found) <= set(range(20, 28))
    assert uneven_columns(ground) == list(range(16, 32))


def test_unmatched_pixels_neither_make_ground_uneven_nor_hide_that_it_is():
    assert uneven_columns([0.09] * 20 + [np.nan] * 20) == []
    behind_gap = step(0.05)
    behind_gap[22:24] = np.nan, np.nan
    assert uneven_columns(behind_gap)[:4] == [16, 17, 18, 19]
