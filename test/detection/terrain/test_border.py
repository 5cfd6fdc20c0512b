"""Slopes and walls in the left border, which is not visible in the right image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.terrain.border import (
    slope_in_border,
    walls_in_border,
)
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.terrain import Terrain

PARAMETERS = TerrainParameters(border_reach_m=0.12)
CAMERA = StereoCamera(100, 50, 100.0, 100.0, 49.5, 24.5, 0.1)


def continued(steep, measured, disparity, parameters=PARAMETERS, camera=CAMERA):
    """Continue a slope on ground with 100 pixels in a metre."""
    height_m = np.where(measured, 0, np.nan).astype(np.float32)
    even = np.zeros(CAMERA.shape, np.float32)
    terrain = Terrain(height_m, even, even, np.full(CAMERA.shape, 100, np.float32), ())
    values = np.where(measured, disparity, 0).astype(np.float32)
    return slope_in_border(steep, terrain, values, camera, parameters)


def continued_columns(steep_columns, disparity=20.0, camera=CAMERA):
    """Columns of a slope beyond those that are measured, from column 20 on."""
    steep, measured = np.zeros((2, *CAMERA.shape), bool)
    measured[:, 20:] = True
    steep[:, steep_columns] = True
    found = continued(steep, measured, disparity, camera=camera)
    assert (found == found[0]).all()
    return np.flatnonzero(found[0]).tolist()


def test_a_slope_continues_within_reach():
    assert continued_columns(slice(20, 60)) == list(range(8, 20))


def test_a_slope_does_not_continue_where_the_right_image_shows_it():
    # With a smaller disparity, the unmeasured columns are in the right image as well.
    assert continued_columns(slice(20, 60), disparity=8.0) == list(range(8, 13))


def test_the_right_camera_may_look_elsewhere():
    # Its centre is 3 px farther left: columns are seen 3 px farther left than the disparity says.
    camera = replace(CAMERA, cx_right=46.5)
    assert continued_columns(slice(20, 60), 8.0, camera) == list(range(8, 16))


def test_a_slope_that_ends_before_the_border_does_not_continue():
    assert continued_columns(slice(30, 60)) == []


def walls(height_m, high=np.s_[:, 20:60], disparity=40.0, pixels_per_metre=20.0):
    """Continue a wall that is measured from column 30 on."""
    measured, marked = np.zeros((2, *CAMERA.shape), bool)
    measured[:, 30:] = True
    marked[high] = True
    height_m = np.where(measured, np.where(marked, height_m, 0), np.nan).astype(np.float32)
    even = np.zeros(CAMERA.shape, np.float32)
    scale = np.full(CAMERA.shape, pixels_per_metre, np.float32)
    terrain = Terrain(height_m, even, even, scale, ())
    values = np.where(measured, disparity, 0).astype(np.float32)
    return walls_in_border(marked & measured, terrain, values, CAMERA, PARAMETERS)


@pytest.mark.parametrize(
    ('height_m', 'columns'),
    [
        (0.6, range(18, 30)),
        (1.0, range(10, 30)),
        (3.0, range(30)),
        # Not higher than rocks.
        (0.45, range(0)),
    ],
)
def test_a_wall_continues_into_the_border_as_far_as_it_is_high(height_m, columns):
    found = walls(height_m)
    assert (found == found[0]).all()
    assert np.flatnonzero(found[0]).tolist() == list(columns)


def test_a_wall_continues_beside_itself_only():
    found = walls(3.0, np.s_[:20, 20:60])
    assert found[:15, :30].all()
    assert not found[20:, 29].any()


def test_a_wall_does_not_continue_where_the_right_image_shows_what_is_there():
    found = walls(3.0, disparity=20.0)
    assert np.flatnonzero(found[0]).tolist() == list(range(25))


def test_what_is_no_obstacle_does_not_continue_however_high():
    assert not walls(3.0, np.s_[:, 40:60]).any()


def test_each_measured_pixel_has_a_reach_of_its_own():
    measured, high = np.zeros((2, 1, 100), bool)
    measured[:, [0, 9]] = high[:, [0, 9]] = True
    # Walls reach as far as they are high, here with 1 pixel in a metre.
    height_m = np.full(measured.shape, np.nan, np.float32)
    height_m[:, 0], height_m[:, 9] = 1, 3
    even = np.ones(measured.shape, np.float32)
    terrain = Terrain(height_m, even, even, even, ())
    camera = replace(CAMERA, height=1)
    found = walls_in_border(high, terrain, np.full_like(even, 200), camera, PARAMETERS)
    assert np.flatnonzero(found).tolist() == [1, 6, 7, 8, 10, 11, 12]
