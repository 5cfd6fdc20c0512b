"""One ground point for each cell."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.result import thinning
from rover_obstacle_detection.detection.result.thinning import one_per_cell

LEVEL = GroundPlane((0.0, -1.0, 0.0), 1.0, (0.0, -1.0, 0.0))


def ground(*places):
    """Points at x and z on the level ground below the camera."""
    return np.array([(x, 1.0, z) for x, z in places], np.float32)


def test_the_last_point_of_each_cell_is_kept():
    points = ground((0.01, 1.01), (0.04, 1.04), (0.06, 1.01), (0.01, 1.06), (0.02, 1.02))
    np.testing.assert_array_equal(one_per_cell(points, LEVEL, 0.05), [2, 3, 4])


def test_points_to_the_left_and_right_of_the_camera_are_in_different_cells():
    points = ground((-0.01, 1.0), (0.01, 1.0))
    np.testing.assert_array_equal(one_per_cell(points, LEVEL, 0.05), [0, 1])


def test_height_makes_no_cells():
    points = np.array([(0.0, 0.2, 1.0), (0.0, 1.0, 1.0)], np.float32)
    np.testing.assert_array_equal(one_per_cell(points, LEVEL, 0.05), [1])


def test_cells_lie_in_a_tilted_plane():
    tilt = math.radians(60)
    up = (0.0, -math.cos(tilt), -math.sin(tilt))
    # Forward along the plane, a step of the optical axis is twice as long.
    points = np.array([(0, 0, 1.0), (0, -0.03 * math.tan(tilt), 1.03)], np.float32)
    assert len(one_per_cell(points, GroundPlane(up, 1.0, up), 0.05)) == 2
    assert len(one_per_cell(points, LEVEL, 0.05)) == 1


def test_large_maps_are_thinned_likewise(monkeypatch):
    generator = np.random.default_rng(0)
    points = ground(*generator.uniform((-2, 0), (2, 4), (2000, 2)))
    filled = one_per_cell(points, LEVEL, 0.1)
    monkeypatch.setattr(thinning, '_MAX_CELLS', 0)
    np.testing.assert_array_equal(one_per_cell(points, LEVEL, 0.1), filled)
    assert 1000 < len(filled) < 1600


@pytest.mark.parametrize('count', [0, 1])
def test_few_points_are_kept(count):
    np.testing.assert_array_equal(
        one_per_cell(ground((0, 1))[:count], LEVEL, 0.05), np.arange(count)
    )


def test_points_behind_the_camera_have_cells_too():
    points = ground((0.01, -1.01), (0.01, 1.01), (-0.01, -1.01), (0.02, -1.02))
    np.testing.assert_array_equal(one_per_cell(points, LEVEL, 0.05), [1, 2, 3])
