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


def uneven_columns(step_m, *, noise_m=0.0, obstacles=None, **parameters):
    """Columns of ground with a step at column 20 that are uneven in its middle row."""
    height_m = np.zeros((21, 40), np.float32)
    height_m[:, 20:] = step_m
    obstacles = np.zeros(height_m.shape, bool) if obstacles is None else obstacles
    found = uneven(terrain_of(height_m, noise_m), obstacles, replace(PARAMETERS, **parameters))
    return np.flatnonzero(found[10]).tolist()


@pytest.mark.parametrize('sign', [1, -1], ids=['up', 'down'])
def test_ground_is_uneven_where_a_step_is_within_the_window(sign):
    assert uneven_columns(sign * 0.05) == list(range(16, 24))
    assert uneven_columns(sign * 0.02) == []
    assert uneven_columns(sign * 0.05, max_step_m=0.25) == []


def test_what_noise_explains_is_not_uneven():
    assert uneven_columns(0.04, noise_m=0.005) != []
    assert uneven_columns(0.04, noise_m=0.02) == []


def test_neither_obstacles_nor_unmatched_pixels_make_the_ground_beside_them_uneven():
    obstacles = np.zeros((21, 40), bool)
    obstacles[:, 20:24] = True
    assert uneven_columns(0.08, obstacles=obstacles)[0] > 19
    assert uneven_columns(np.nan) == []
