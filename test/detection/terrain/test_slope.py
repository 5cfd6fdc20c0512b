from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.gradient import Rise
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.slope import (
    hollow_depth,
    level_heights,
    steep_cells,
)

CELL_M = 0.05
ROWS, COLUMNS = np.mgrid[:60, :80] * CELL_M
INNER = np.s_[2:-2, 2:-2]
PARAMETERS = TerrainParameters()


def ground(pitch_deg=46.0, tilt_deg=0.0):
    """Ground that rises forward by ``tilt_deg``, before a camera that looks down on it."""
    return GroundPlane(
        Gravity.from_angles(pitch_deg + tilt_deg).up,
        1.0,
        Gravity.from_angles(pitch_deg).up,
    )


def ramp(angle_deg, towards_deg=0.0):
    """Relief that rises towards a direction, 0 forward and 90 to the right."""
    towards = math.radians(towards_deg)
    rise = math.tan(math.radians(angle_deg))
    return (rise * (math.cos(towards) * ROWS + math.sin(towards) * COLUMNS)).astype(np.float32)


def rise_of(relief, noise=0.0, scale_m=0.1):
    forward, right = np.gradient(np.asarray(relief, np.float32), CELL_M)
    noise, scale_m = (np.full(relief.shape, each, np.float32) for each in (noise, scale_m))
    return Rise(right, forward, noise, scale_m, CELL_M)


def steep(relief, plane, limit=20.0, noise=0.0):
    parameters = replace(PARAMETERS, max_slope_deg=limit)
    inner = steep_cells(rise_of(relief, noise), plane, parameters).found[INNER]
    assert inner.shape == relief[INNER].shape
    assert inner.all() or not inner.any()
    return bool(inner.all())


@pytest.mark.parametrize('towards', range(0, 360, 45))
@pytest.mark.parametrize(
    ('angle', 'expected'), [(0, False), (19.5, False), (20.5, True), (45, True)]
)
def test_slope_is_steep_in_every_direction(towards, angle, expected):
    assert steep(ramp(angle, towards), ground()) == expected


@pytest.mark.parametrize('pitch', [0.0, 46.0, 80.0])
def test_camera_pitch_is_no_slope(pitch):
    assert not steep(ramp(0), ground(pitch))


@pytest.mark.parametrize(
    ('tilt', 'expected'), [(12, False), (19.5, False), (20.5, True), (26, True)]
)
@pytest.mark.parametrize('sign', [-1, 1])
def test_ground_plane_itself_may_be_steep(tilt, expected, sign):
    assert steep(ramp(0), ground(tilt_deg=sign * tilt)) == expected


def test_relief_adds_to_the_tilt_of_the_plane():
    uphill = ground(tilt_deg=15)
    assert steep(ramp(8), uphill)
    assert not steep(ramp(-8), uphill)
    assert not steep(ramp(-30), uphill)
    assert steep(ramp(-38), uphill)
    # At right angles the cosines multiply: acos(cos 15 cos 8) is 16.9 degrees.
    assert not steep(ramp(8, 90), uphill)
    assert not steep(ramp(-13, 90), uphill)
    assert steep(ramp(15, 90), uphill)


def test_relief_adds_to_a_sideways_tilt_of_the_plane():
    tilted = GroundPlane(Gravity.from_angles(0, 15).up, 1.0, Gravity.from_angles(0).up)
    # The normal leans left: the ground rises to the right.
    assert steep(ramp(8, 90), tilted)
    assert not steep(ramp(-8, 90), tilted)


@pytest.mark.parametrize(('limit', 'expected'), [(10, True), (16, False)])
def test_limit_is_a_parameter(limit, expected):
    assert steep(ramp(13), ground(), limit) == expected


def test_too_noisy_rise_is_no_slope():
    assert steep(ramp(30), ground(), noise=0.2)
    assert not steep(ramp(30), ground(), noise=0.5)


@pytest.mark.parametrize('limit', [20, 30])
@pytest.mark.parametrize('noise_deg', [0.0, 2.0, 5.0])
def test_slope_is_possible_within_smoothing_and_two_deviations_of_noise(noise_deg, limit):
    noise = math.tan(math.radians(noise_deg))
    parameters = replace(PARAMETERS, max_slope_deg=limit)
    below = limit - PARAMETERS.lost_slope_deg - 2 * noise_deg
    for angle, possible in ((below - 0.5, False), (below + 0.5, True), (limit + 5, True)):
        rise = rise_of(ramp(angle), noise, parameters.scales_of_rise_m[0])
        inner = steep_cells(rise, ground(), parameters).possible[INNER]
        assert inner.all() if possible else not inner.any(), angle


@pytest.mark.parametrize(
    ('scale_m', 'max_step_m', 'least_deg'),
    [
        # A ledge of a step would be steeper than the limit.
        (0.1, 0.1, 17.5),
        # 0.10 m over 0.25 m, or over 0.5 m, times the square root of 2 pi.
        (0.25, 0.1, 9.1),
        (0.5, 0.1, 4.6),
        (0.5, 0.2, 9.1),
        (0.25, 0.05, 4.6),
    ],
)
def test_at_a_wide_scale_a_ledge_is_possible_from_the_slope_it_would_have(
    scale_m, max_step_m, least_deg
):
    parameters = replace(PARAMETERS, max_step_m=max_step_m)
    for angle, possible in ((least_deg - 0.2, False), (least_deg + 0.2, True)):
        cells = steep_cells(rise_of(ramp(angle), scale_m=scale_m), ground(), parameters)
        assert not cells.found.any()
        inner = cells.possible[INNER]
        assert inner.all() if possible else not inner.any(), angle


def test_a_small_limit_leaves_level_ground_free():
    parameters = replace(PARAMETERS, max_slope_deg=2.0)
    noise = math.tan(math.radians(0.3))
    assert not steep_cells(rise_of(ramp(0), noise), ground(), parameters).possible[INNER].any()
    assert steep_cells(rise_of(ramp(1.8), noise), ground(), parameters).possible[INNER].all()


def test_what_is_not_known_is_possible():
    relief = ramp(0)
    relief[20, 30] = np.nan
    assert steep_cells(rise_of(relief), ground(), PARAMETERS).possible[19:22, 30].any()


def test_slope_is_possible_wherever_the_rise_is_not_known():
    assert steep_cells(rise_of(ramp(0), noise=0.5), ground(), PARAMETERS).possible.all()


def noisy_slope(angles_deg, noise_deg=2.0, scale_m=0.14):
    forward = np.tan(np.radians(angles_deg)).astype(np.float32)
    noise, scale_m = (
        np.full_like(forward, each) for each in (math.tan(math.radians(noise_deg)), scale_m)
    )
    return steep_cells(Rise(0 * forward, forward, noise, scale_m, CELL_M), ground(), PARAMETERS)


@pytest.mark.parametrize(
    ('angle', 'cells', 'is_certain'),
    [
        # A single sample of a rise that is known to 2 degrees.
        (23.8, 3, False),
        (24.2, 3, True),
        # Some thirty samples.
        (20.5, 60, False),
        (21.0, 60, True),
    ],
)
def test_a_slope_is_certain_if_its_mean_is_beyond_noise(angle, cells, is_certain):
    angles_deg = np.zeros((60, 80))
    angles_deg[:cells, :cells] = angle
    hazard = noisy_slope(angles_deg)
    np.testing.assert_array_equal(hazard.found, angles_deg > 0)
    np.testing.assert_array_equal(hazard.certain, hazard.found & is_certain)
    assert hazard.possible[hazard.found].all()


@pytest.mark.parametrize(('clear', 'is_certain'), [(5, False), (6, True)])
def test_a_slope_is_certain_if_enough_of_its_cells_are_beyond_noise(clear, is_certain):
    angles_deg = np.zeros((60, 80))
    angles_deg[10:20, 10:20] = 18
    angles_deg[10:16, 10:20] = 20.1
    angles_deg[10, 10 : 10 + clear] = 24.2
    hazard = noisy_slope(angles_deg)
    assert hazard.found.sum() == 100
    assert hazard.certain.sum() == 100 * is_certain


@pytest.mark.parametrize('angle', [17, 18, 19])
def test_noise_makes_no_slope_below_the_limit_certain(angle):
    random = np.random.default_rng(3)
    # A sample in each cell.
    noisy_deg = angle + 2 * random.standard_normal((60, 80))
    hazard = noisy_slope(noisy_deg, scale_m=CELL_M / math.sqrt(4 * math.pi))
    assert hazard.found.any()
    assert hazard.certain.mean() < 0.01


def steep_rows(*angles_deg, rows_each=20):
    """Which rows are steep on ground whose slope changes every 20 rows."""
    rise = np.repeat(np.tan(np.radians(angles_deg)), rows_each) * CELL_M
    relief = np.broadcast_to(np.cumsum(rise)[:, np.newaxis], (len(rise), 30))
    found = steep_cells(rise_of(relief), ground(), PARAMETERS).found
    return found[1:-1, 15]


def test_nearly_steep_ground_belongs_to_the_steep_slope_it_joins():
    assert steep_rows(0, 19, 25, 25, 19, 0)[21:98].all()
    # Not by itself, nor where it is most of the slope.
    assert not steep_rows(0, 19, 0).any()
    found = steep_rows(0, 19, 19, 25, 19, 0)
    assert found[62:78].all()
    assert not found[21:55].any()
    # Clearly less steep ground does not.
    assert not steep_rows(0, 17, 25, 0)[:38].any()


@pytest.mark.parametrize('missing', [0, 1])
def test_nearly_steep_ground_counts_from_a_share_of_steep_cells_on(missing):
    angles_deg = np.zeros((10, 30))
    # 60 of 150 cells are too steep.
    angles_deg[2:7], angles_deg[5:7] = 19, 25
    angles_deg[6, 20 : 20 + missing] = 19
    forward = np.tan(np.radians(angles_deg)).astype(np.float32)
    rise = Rise(0 * forward, forward, 0 * forward, np.full_like(forward, 0.1), CELL_M)
    found = steep_cells(rise, ground(), PARAMETERS).found
    np.testing.assert_array_equal(found, angles_deg > (24 if missing else 18))


@pytest.mark.parametrize('tilt', [-15.0, 0.0, 20.0])
def test_level_heights_are_along_the_vertical(tilt):
    plane = ground(tilt_deg=tilt)
    heights = level_heights(ramp(-tilt), CELL_M, plane)
    np.testing.assert_allclose(heights, 0, atol=1e-5)


@pytest.mark.parametrize('tilt', [-15.0, 20.0])
def test_level_heights_over_a_plane_that_rises_to_the_right(tilt):
    plane = GroundPlane(Gravity.from_angles(0, tilt).up, 1.0, Gravity.from_angles(0).up)
    np.testing.assert_allclose(level_heights(ramp(-tilt, 90), CELL_M, plane), 0, atol=1e-5)


def test_foot_of_a_slope_is_no_hollow_over_a_tilted_plane():
    # Level, then 26 degrees up, over a plane that rises by 13 degrees throughout.
    up = np.maximum(ROWS - 1.5, 0) * math.tan(math.radians(26))
    plane = ground(tilt_deg=13)
    tilt = math.radians(13)
    over_plane = (up * math.cos(tilt) - ROWS * math.sin(tilt)).astype(np.float32)
    assert drops(over_plane).any()
    assert not drops(level_heights(over_plane, CELL_M, plane)).any()


def drops(relief, seen=None, limit=0.1):
    seen = np.ones(relief.shape, bool) if seen is None else seen
    depth_m = hollow_depth(relief.astype(np.float32), seen, CELL_M, PARAMETERS)
    assert depth_m.shape == relief.shape
    assert not depth_m[~seen].any()
    return depth_m > limit


def hollow(depth):
    relief = np.zeros((80, 100))
    relief[32:48, 42:58] = -depth
    return relief


def test_hole_is_found_to_its_rim():
    relief = hollow(0.3)
    np.testing.assert_array_equal(drops(relief), relief < 0)


@pytest.mark.parametrize(('depth', 'found'), [(0.09, False), (0.11, True)])
def test_drop_is_deeper_than_the_limit(depth, found):
    assert drops(hollow(depth)).any() == found


def test_depth_limit_may_vary_over_the_map():
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


@pytest.mark.parametrize(('width_m', 'found'), [(1.8, True), (2.0, False)])
def test_hollow_is_at_most_as_wide_as_a_parameter_says(width_m, found):
    rows, columns = np.abs(np.mgrid[:80, :100] - np.array([39.5, 49.5])[:, None, None]) * CELL_M
    relief = np.where(np.maximum(rows, columns) < width_m / 2, -0.3, 0)
    assert drops(relief)[40, 50] == found


def test_ground_that_falls_towards_unseen_ground_is_no_drop():
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


def test_empty_and_tiny_maps_have_no_drop():
    relief = np.zeros((1, 1))
    assert not drops(relief, np.zeros((1, 1), bool)).any()
    assert not drops(relief).any()
    assert not drops(np.zeros((3, 40))).any()
