from __future__ import annotations

import math

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.gradient import Rise
from rover_obstacle_detection.detection.terrain.slope import (
    dropped_cells,
    level_heights,
    steep_cells,
)

CELL_M = 0.05
ROWS, COLUMNS = np.mgrid[:60, :80] * CELL_M
INNER = np.s_[2:-2, 2:-2]


def ground(pitch_deg=46.0, tilt_deg=0.0, roll_deg=0.0):
    """Seen by a camera pitched by ``pitch_deg``, rising forward by ``tilt_deg``."""
    return GroundPlane(
        Gravity.from_angles(pitch_deg + tilt_deg, roll_deg).up,
        1.0,
        Gravity.from_angles(pitch_deg).up,
    )


def ramp(angle_deg, towards_deg=0.0):
    """Relief rising by an angle towards a direction, 0 forward and 90 to the right."""
    towards = math.radians(towards_deg)
    rise = math.tan(math.radians(angle_deg))
    return (rise * (math.cos(towards) * ROWS + math.sin(towards) * COLUMNS)).astype(np.float32)


def rise_of(relief, noise=0.0):
    forward, right = np.gradient(np.asarray(relief, np.float32), CELL_M)
    return Rise(right, forward, np.full(relief.shape, noise, np.float32))


def steep(relief, plane, limit=20.0, noise=0.0):
    found = steep_cells(rise_of(relief, noise), plane, limit)
    assert found.dtype == np.bool_
    assert found.shape == relief.shape
    inner = found[INNER]
    assert inner.all() or not inner.any()
    return bool(inner.all())


@pytest.mark.parametrize('towards', range(0, 360, 45))
@pytest.mark.parametrize(
    ('angle', 'expected'), [(0, False), (19.5, False), (20.5, True), (45, True)]
)
def test_slope_counts_in_every_direction(towards, angle, expected):
    assert steep(ramp(angle, towards), ground()) == expected


@pytest.mark.parametrize('pitch', [0.0, 46.0, 80.0])
def test_pitch_of_the_camera_is_no_slope(pitch):
    assert not steep(ramp(0), ground(pitch))


@pytest.mark.parametrize(
    ('tilt', 'expected'), [(12, False), (19.5, False), (20.5, True), (26, True)]
)
@pytest.mark.parametrize('sign', [-1, 1])
def test_plane_itself_may_be_too_steep(tilt, expected, sign):
    assert steep(ramp(0), ground(tilt_deg=sign * tilt)) == expected


def test_relief_adds_to_the_tilt_of_the_plane():
    # The camera pitched further down against the plane: the plane rises forward.
    uphill = ground(tilt_deg=15)
    assert steep(ramp(8), uphill)
    assert not steep(ramp(-8), uphill)
    assert not steep(ramp(-30), uphill)
    assert steep(ramp(-38), uphill)
    # At right angles they add as vectors: cos 15 cos 8 is 16.9 degrees.
    assert not steep(ramp(8, 90), uphill)
    assert not steep(ramp(-13, 90), uphill)
    assert steep(ramp(15, 90), uphill)


def test_sideways_tilt_and_relief():
    tilted = GroundPlane(Gravity.from_angles(0, 15).up, 1.0, Gravity.from_angles(0).up)
    # Normal leaning left: the ground rises to the right.
    assert steep(ramp(8, 90), tilted)
    assert not steep(ramp(-8, 90), tilted)


@pytest.mark.parametrize(('limit', 'expected'), [(10, True), (16, False)])
def test_limit_is_the_rovers(limit, expected):
    assert steep(ramp(13), ground(), limit) == expected


def test_rise_that_may_be_anything_is_no_slope():
    assert steep(ramp(30), ground(), noise=0.2)
    assert not steep(ramp(30), ground(), noise=0.5)


def steep_rows(*angles_deg, rows_each=20):
    rise = np.repeat(np.tan(np.radians(angles_deg)), rows_each) * CELL_M
    relief = np.broadcast_to(np.cumsum(rise)[:, np.newaxis], (len(rise), 30))
    found = steep_cells(rise_of(relief), ground(), 20.0)
    return found[1:-1, 15]


def test_hardly_less_steep_ground_belongs_to_the_steep_slope_it_joins():
    assert steep_rows(0, 19, 25, 25, 19, 0)[21:98].all()
    # Alone, or if it is most of the whole, it is none.
    assert not steep_rows(0, 19, 0).any()
    found = steep_rows(0, 19, 19, 25, 19, 0)
    assert found[62:78].all()
    assert not found[21:55].any()
    # What is clearly less steep does not.
    assert not steep_rows(0, 17, 25, 0)[:38].any()


@pytest.mark.parametrize('tilt', [-15.0, 0.0, 20.0])
def test_level_heights_are_along_the_vertical(tilt):
    plane = ground(tilt_deg=tilt)
    heights = level_heights(ramp(-tilt), CELL_M, plane)
    np.testing.assert_allclose(heights, 0, atol=1e-5)


def test_the_foot_of_a_slope_is_no_hollow_over_a_tilted_plane():
    # Level, then 26 degrees up, over a plane that rises by 13 degrees throughout.
    up = np.maximum(ROWS - 1.5, 0) * math.tan(math.radians(26))
    plane = ground(tilt_deg=13)
    over_plane = (up * math.cos(math.radians(13)) - ROWS * math.sin(math.radians(13))).astype(
        np.float32
    )
    assert drops(over_plane).any()
    assert not drops(level_heights(over_plane, CELL_M, plane)).any()


def drops(relief, seen=None, surroundings=2.0, limit=0.1):
    seen = np.ones(relief.shape, bool) if seen is None else seen
    found = dropped_cells(relief.astype(np.float32), seen, CELL_M, surroundings, limit)
    assert found.dtype == np.bool_
    assert found.shape == relief.shape
    return found


def hollow(depth, size_m=0.8, shape=(80, 100)):
    half = round(size_m / CELL_M / 2)
    relief = np.zeros(shape)
    relief[40 - half : 40 + half, 50 - half : 50 + half] = -depth
    return relief


def test_hole_is_found_to_its_brim():
    relief = hollow(0.3)
    np.testing.assert_array_equal(drops(relief), relief < 0)


@pytest.mark.parametrize(('depth', 'found'), [(0.09, False), (0.11, True)])
def test_depth_counts_against_the_limit(depth, found):
    assert drops(hollow(depth)).any() == found


def test_limit_of_the_depth_may_vary_over_the_map():
    relief = hollow(0.3)
    limit = np.full(relief.shape, 0.1, np.float32)
    limit[:, 50:] = 0.4
    left = np.broadcast_to(np.arange(100) < 50, relief.shape)
    np.testing.assert_array_equal(drops(relief, limit=limit), (relief < 0) & left)


def test_flat_ground_and_slopes_are_no_drops():
    assert not drops(np.zeros((80, 100))).any()
    rows, columns = np.mgrid[:80, :100] * CELL_M
    assert not drops(0.3 * rows)[2:-2].any()
    assert not drops(-0.3 * columns)[:, 2:-2].any()


def test_wide_valley_is_terrain():
    relief = np.zeros((80, 160))
    relief[:, 40:120] = -0.3
    assert not drops(relief)[:, 50:110].any()


def test_ground_that_falls_towards_what_nobody_saw_is_no_drop():
    relief = np.zeros((80, 100))
    relief[50:] = -0.3
    assert not drops(relief).any()
    seen = np.ones_like(relief, bool)
    seen[70:] = False
    assert not drops(relief, seen).any()


def test_unseen_cells_are_no_drop():
    relief = hollow(0.3)
    seen = np.random.default_rng(0).random(relief.shape) < 0.8
    np.testing.assert_array_equal(drops(relief, seen), (relief < 0) & seen)


def test_empty_and_tiny_maps():
    relief = np.zeros((1, 1))
    assert not drops(relief, np.zeros((1, 1), bool)).any()
    assert not drops(relief).any()
    assert not drops(np.zeros((3, 40))).any()
