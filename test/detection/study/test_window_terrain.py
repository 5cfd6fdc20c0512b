from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.study.window_terrain import (
    elevation_along,
    window_roughness,
    window_step,
)


def camera(width=40, height=30, fx=40.0, fy=40.0, cx=19.5, cy=14.5, baseline=0.5):
    return StereoCamera(width, height, fx, fy, cx, cy, baseline)


def plane_disparity(each, normal, distance_m):
    """Disparity of the plane ``normal . P = -distance``; 0 where its ray misses it."""
    x, y = each.rays()
    inverse_depth = -(normal[0] * x.astype(float) + normal[1] * y + normal[2]) / distance_m
    return np.maximum(each.fx * each.baseline_m * inverse_depth, 0).astype(np.float32)


def level_ground(each, pitch_deg, height_m):
    up = Gravity.from_angles(pitch_deg).up
    return plane_disparity(each, up, height_m), np.array(up, np.float32)


@settings(max_examples=60)
@given(
    pitch=st.floats(-70, 70),
    roll=st.floats(-70, 70),
    distance=st.floats(0.3, 20),
    fx=st.floats(20, 200),
    fy=st.floats(20, 200),
    cx=st.floats(0, 40),
    cy=st.floats(0, 30),
    baseline=st.floats(0.05, 1),
    size=st.sampled_from([3, 5, 9]),
)
def test_a_plane_has_no_roughness_at_any_tilt(
    pitch, roll, distance, fx, fy, cx, cy, baseline, size
):
    each = camera(fx=fx, fy=fy, cx=cx, cy=cy, baseline=baseline)
    # A wall straight ahead, rotated by two angles.
    a, b = math.radians(pitch), math.radians(roll)
    normal = (math.sin(b) * math.cos(a), math.sin(a), -math.cos(b) * math.cos(a))
    disparity = plane_disparity(each, normal, distance)
    roughness = window_roughness(disparity, each, size)
    known = np.isfinite(roughness)
    depth = each.depth_m(1.0) / np.maximum(disparity, 1e-6)
    # Rounding a disparity to float32 moves its point by the same share of its distance.
    assert (roughness[known] <= 1e-6 * np.maximum(depth[known], distance)).all()
    all_valid = disparity.min() > 0
    assert not all_valid or known.all()


@pytest.mark.parametrize('distance_m', [2.0, 80.0])
def test_roughness_is_measured_perpendicular_to_the_plane(distance_m):
    each = camera()
    disparity = plane_disparity(each, (0.0, -0.8, -0.6), distance_m)
    expected = 0.01
    # The points of a chequerboard are moved along their rays, a centimetre to either side.
    rows, columns = np.mgrid[:30, :40]
    sign = np.where((rows + columns) % 2, 1, -1)
    moved = (disparity * (1 + sign * expected / distance_m)).astype(np.float32)
    roughness = window_roughness(moved, each, 5)
    np.testing.assert_allclose(roughness[4:-4, 4:-4], expected, rtol=0.05)


def brute_force_roughness(disparity, each, size, row, column):
    half = size // 2
    window = [
        (u, v, float(disparity[v, u]))
        for v in range(max(row - half, 0), min(row + half + 1, each.height))
        for u in range(max(column - half, 0), min(column + half + 1, each.width))
        if disparity[v, u] > 0
    ]
    if len(window) < 3:
        return math.nan
    u, v, d = np.array(window).T
    design = np.column_stack((u - column, v - row, np.ones_like(u)))
    if np.linalg.matrix_rank(design) < 3:
        return math.nan
    a, b, c = np.linalg.lstsq(design, d, rcond=None)[0]
    centre = c + a * (each.cx - column) + b * (each.cy - row)
    distance = each.fx * each.baseline_m / math.hypot(a * each.fx, b * each.fy, centre)
    return np.abs(design @ (a, b, c) - d).mean() * distance / c if c > 0 else math.nan


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), share=st.floats(0, 1), size=st.sampled_from([3, 5]))
def test_roughness_is_relative_to_a_least_squares_plane(seed, share, size):
    generator = np.random.default_rng(seed)
    each = camera(width=8, height=6, cx=3.5, cy=2.5, fx=10.0, fy=12.0)
    disparity = generator.uniform(5, 6, (6, 8)).astype(np.float32)
    disparity[generator.random((6, 8)) < share] = 0
    expected = [
        [brute_force_roughness(disparity, each, size, row, column) for column in range(8)]
        for row in range(6)
    ]
    found = window_roughness(disparity, each, size)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5)


def test_roughness_needs_three_points_that_are_not_collinear():
    each = camera(width=9, height=9, cx=4, cy=4)
    disparity = np.zeros((9, 9), np.float32)
    disparity[4, 3:6] = 5
    assert np.isnan(window_roughness(disparity, each, 3)).all()
    disparity[3, 4] = 5
    assert window_roughness(disparity, each, 3)[4, 4] == pytest.approx(0, abs=1e-6)
    assert np.isnan(window_roughness(np.zeros((9, 9), np.float32), each, 5)).all()


@pytest.mark.parametrize('pitch', [0.0, 20.0, 46.0, 70.0, 90.0])
def test_level_ground_has_no_step_at_any_pitch(pitch):
    each = camera()
    disparity, up = level_ground(each, pitch, 1.0)
    disparity[disparity < each.disparity_at(20)] = 0
    elevation = elevation_along(reproject(disparity, each), up)
    np.testing.assert_allclose(elevation[disparity > 0], -1.0, atol=2e-5)
    step = window_step(elevation, 5)
    assert np.nanmax(step, initial=0) < 4e-5
    assert np.isfinite(step[disparity > 0]).mean() > 0.9 or pitch == 0


@pytest.mark.parametrize('pitch', [10.0, 46.0, 80.0])
def test_step_is_measured_along_gravity(pitch):
    each = camera()
    low, up = level_ground(each, pitch, 1.0)
    high, _ = level_ground(each, pitch, 0.9)
    disparity = low.copy()
    disparity[:, 20:] = high[:, 20:]
    disparity[:12] = 0
    step = window_step(elevation_along(reproject(disparity, each), up), 5)
    np.testing.assert_allclose(step[14:, 18:22], 0.10, atol=5e-5)
    np.testing.assert_allclose(step[14:, :18], 0, atol=5e-5)
    np.testing.assert_allclose(step[14:, 22:], 0, atol=5e-5)


def test_step_is_the_elevation_range_in_the_window():
    elevation = np.zeros((9, 9), np.float32)
    elevation[4, 4] = 0.3
    elevation[4, 6] = -0.2
    step = window_step(elevation, 5)
    assert step.dtype == np.float32
    assert step[4, 5] == pytest.approx(0.5)
    assert step[4, 2] == pytest.approx(0.3)
    assert step[4, 8] == pytest.approx(0.2)
    assert step[0, 0] == 0
    assert step[1, 4] == 0


def test_step_ignores_missing_points_and_needs_three_others():
    elevation = np.full((7, 7), np.nan, np.float32)
    elevation[3, 2:4] = (0.0, 0.4)
    assert np.isnan(window_step(elevation, 3)).all()
    elevation[2, 3] = 0.1
    step = window_step(elevation, 3)
    assert step[3, 3] == step[2, 2] == pytest.approx(0.4)
    assert np.isnan(step[5, 5])
    assert np.isnan(step[3, 5])


def test_elevation_is_along_the_vertical():
    up = np.array([0.0, -0.6, -0.8], np.float32)
    points = np.array([[[1.0, 2.0, 3.0], [5.0, -1.0, 0.5], [np.nan] * 3]], np.float32)
    elevation = elevation_along(points, up)
    assert elevation.shape == (1, 3)
    assert elevation.dtype == np.float32
    np.testing.assert_allclose(elevation, [[-3.6, 0.2, np.nan]], atol=1e-6)
