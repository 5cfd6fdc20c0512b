from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.terrain.elevation_map import (
    MapPositions,
    cell_means,
    ground_axes,
    map_positions,
    plane_coordinates,
    sample_map,
)

CAMERA = StereoCamera(64, 48, 50.0, 50.0, 31.5, 23.5, 0.1)


def ground(pitch_deg=46.0, roll_deg=0.0):
    up = Gravity.from_angles(pitch_deg, roll_deg).up
    return GroundPlane(up, 1.0, up)


def plane_disparity(plane):
    return np.maximum(DisparityPlane.from_ground(plane, CAMERA).disparity(CAMERA), 0)


def placed(disparity, plane, cell_m, max_range_m):
    usable = disparity > CAMERA.disparity_at(max_range_m)
    return map_positions(*plane_coordinates(disparity, CAMERA, plane), usable, cell_m)


def positions(columns, rows, shape=(3, 4), cell_m=0.5):
    return MapPositions(
        np.array([columns], np.float32), np.array([rows], np.float32), shape, cell_m
    )


@given(pitch=st.floats(-60, 80), roll=st.floats(-60, 60))
def test_axes_lie_in_the_plane(pitch, roll):
    plane = ground(pitch, roll)
    right, forward = ground_axes(plane)
    axes = np.stack((right, forward, plane.normal))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    assert right[0] > 0
    assert forward @ (0, 0, 1) > 0 or abs(pitch) > 59


@pytest.mark.parametrize('pitch', [-20.0, 46.0])
def test_a_camera_that_does_not_roll_has_its_right_along_the_ground(pitch):
    np.testing.assert_allclose(ground_axes(ground(pitch))[0], (1, 0, 0), atol=1e-12)


def test_axes_of_a_level_camera():
    right, forward = ground_axes(ground(0.0))
    np.testing.assert_allclose(right, (1, 0, 0), atol=1e-12)
    np.testing.assert_allclose(forward, (0, 0, 1), atol=1e-12)


@pytest.mark.parametrize(('pitch', 'roll'), [(46, 0), (30, 10), (75, -5)])
def test_coordinates_are_positions_along_the_plane(pitch, roll):
    plane = ground(pitch, roll)
    disparity = np.random.default_rng(0).uniform(0.5, 20, CAMERA.shape).astype(np.float32)
    points = reproject(disparity, CAMERA).astype(float)
    found = plane_coordinates(disparity, CAMERA, plane)
    for coordinate, axis in zip(found, ground_axes(plane), strict=True):
        assert coordinate.dtype == np.float32
        np.testing.assert_allclose(coordinate, points @ axis, atol=2e-5)


def test_coordinates_without_a_match_are_zero():
    disparity = np.full(CAMERA.shape, 5, np.float32)
    disparity[7, 9] = 0
    for coordinate in plane_coordinates(disparity, CAMERA, ground()):
        assert coordinate[7, 9] == 0
        assert np.isfinite(coordinate).all()


@pytest.mark.parametrize(('pitch', 'roll'), [(46, 0), (30, 10), (75, -5)])
def test_positions_are_coordinates_in_cells(pitch, roll):
    plane = ground(pitch, roll)
    disparity = plane_disparity(plane)
    found = placed(disparity, plane, 0.05, 10.0)
    right, forward = ground_axes(plane)
    points = reproject(disparity, CAMERA)[found.inside].astype(float)
    across, along = points @ right / 0.05, points @ forward / 0.05
    # The map begins with a whole cell.
    np.testing.assert_allclose(found.column[found.inside] + found.first_column, across, atol=1e-3)
    np.testing.assert_allclose(found.row[found.inside] + found.first_row, along, atol=1e-3)


def test_unusable_pixels_are_outside_the_map():
    disparity = plane_disparity(ground(20.0))
    disparity[40, 10] = 0
    found = placed(disparity, ground(20.0), 0.05, 4.0)
    np.testing.assert_array_equal(found.inside, disparity > CAMERA.disparity_at(4.0))
    assert not found.inside[40, 10]
    assert (found.column[~found.inside] <= -5).all()


@settings(max_examples=50)
@given(seed=st.integers(0, 9999), pitch=st.floats(-10, 80), cell=st.sampled_from([0.02, 0.3]))
def test_every_usable_pixel_is_on_the_map(seed, pitch, cell):
    generator = np.random.default_rng(seed)
    disparity = generator.uniform(0.2, 20, CAMERA.shape).astype(np.float32)
    disparity[generator.random(CAMERA.shape) < 0.5] = 0
    found = placed(disparity, ground(pitch), cell, 20.0)
    rows, columns = found.shape
    inside = found.inside
    assert (found.row[inside] >= 0).all()
    assert (found.row[inside] + 0.5 < rows).all()
    assert (found.column[inside] >= 0).all()
    assert (found.column[inside] + 0.5 < columns).all()
    weights = inside.astype(np.float32)
    assert cell_means(weights, weights, found)[1].sum() == np.count_nonzero(inside)


def test_map_without_pixels_is_one_empty_cell():
    nothing = np.zeros(CAMERA.shape, np.float32)
    found = placed(nothing, ground(), 0.05, 10.0)
    assert not found.inside.any()
    mean, weight = cell_means(nothing, nothing, found)
    np.testing.assert_array_equal(mean, [[0]])
    np.testing.assert_array_equal(weight, [[0]])


def test_means_are_weighted():
    place = positions([0.2, -0.4, 2.9, 3.0], [0.6, 1.4, 0.0, 2.0])
    values = np.array([[1, 4, 7, 9]], np.float32)
    weights = np.array([[1, 2, 0.5, 0]], np.float32)
    mean, weight = cell_means(values, weights, place)
    expected_mean, expected_weight = np.zeros((3, 4)), np.zeros((3, 4))
    expected_mean[1, 0], expected_weight[1, 0] = 3, 3
    expected_mean[0, 3], expected_weight[0, 3] = 7, 0.5
    np.testing.assert_allclose(mean, expected_mean, rtol=1e-6)
    np.testing.assert_allclose(weight, expected_weight, rtol=1e-6)
    assert mean.dtype == weight.dtype == np.float32


def test_a_map_may_be_larger_than_its_pixels():
    one = np.ones((1, 2), np.float32)
    mean, weight = cell_means(one, one, positions([0, 1], [0, 0]))
    np.testing.assert_array_equal(mean, [[1, 1, 0, 0], [0] * 4, [0] * 4])
    np.testing.assert_array_equal(weight, mean)


def test_values_without_weight_may_be_nan():
    place = positions([0, 1], [0, 0])
    mean, _ = cell_means(
        np.array([[np.nan, 2]], np.float32), np.array([[0, 1]], np.float32), place
    )
    assert mean[0, 1] == 2
    assert np.isfinite(mean).all()


def test_map_is_interpolated_between_cells():
    grid = np.arange(12, dtype=np.float32).reshape(3, 4)
    sampled = sample_map(grid, positions([0, 1.5, 2.25, 3], [0, 1, 0.5, 2]))
    np.testing.assert_allclose(sampled, [[0, 5.5, 4.25, 11]], atol=0.01)
    assert sampled.dtype == np.float32


def test_map_continues_beyond_its_border():
    grid = np.arange(12, dtype=np.float32).reshape(3, 4)
    np.testing.assert_allclose(sample_map(grid, positions([-10, 9], [-10, 9])), [[0, 11]])
