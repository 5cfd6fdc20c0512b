from __future__ import annotations

import cv2
import numpy as np
import pytest

from rover_obstacle_detection.detection.terrain.local_regression import gaussian_sum, local_planes
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters

SHAPE = (60, 80)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
# The widest runs on a coarser grid.
SIGMAS = [1.0, 2.5, 9.0]


def planes_of(height, weight, sigma, ridge=0.02):
    return local_planes(height, weight, sigma, ridge, TerrainParameters())


@pytest.mark.parametrize('sigma', SIGMAS)
def test_plane_is_exact_up_to_the_edge(sigma):
    weight = np.random.default_rng(1).uniform(0.1, 3, SHAPE).astype(np.float32)
    height = 2 + 0.3 * COLUMNS - 0.2 * ROWS
    planes = planes_of(height, weight, sigma, ridge=1e-4)
    np.testing.assert_allclose(planes.rise_along_columns, 0.3, atol=0.01)
    np.testing.assert_allclose(planes.rise_along_rows, -0.2, atol=0.01)
    inner = np.s_[6:-6, 6:-6]
    np.testing.assert_allclose(planes.height[inner], height[inner], atol=0.05)
    for grid in vars(planes).values():
        assert grid.dtype == np.float32
        assert grid.shape == SHAPE


@pytest.mark.parametrize('sigma', SIGMAS)
def test_weight_and_spread_follow_the_gaussian(sigma):
    planes = planes_of(np.zeros(SHAPE, np.float32), np.ones(SHAPE, np.float32), sigma)
    middle = np.s_[25:35, 35:45]
    np.testing.assert_allclose(planes.weight[middle], 2 * np.pi * sigma**2, rtol=0.06)
    np.testing.assert_allclose(planes.spread[middle], sigma, rtol=0.06)
    # At the edge, half the Gaussian lies outside the map.
    assert planes.weight[30, 0] < 0.75 * planes.weight[30, 40]
    assert planes.spread[30, 0] < 0.85 * planes.spread[30, 40]


@pytest.mark.parametrize('sigma', SIGMAS)
def test_a_gaussian_sum_has_the_weights_of_the_planes(sigma):
    weight = np.random.default_rng(1).uniform(0.1, 3, SHAPE).astype(np.float32)
    total = gaussian_sum(weight, sigma, TerrainParameters())
    np.testing.assert_allclose(total, planes_of(weight, weight, sigma).weight, rtol=1e-4)


def test_cells_on_a_line_have_no_rise_across_it():
    weight = np.zeros(SHAPE, np.float32)
    weight[30] = 1
    planes = planes_of(0.3 * COLUMNS, weight, 2.5)
    assert planes.rise_along_columns[30, 40] == pytest.approx(0.3, abs=0.02)
    assert planes.rise_along_rows[30, 40] == 0
    assert planes.spread[30, 40] == pytest.approx(0, abs=0.01)


def test_empty_map_is_flat():
    planes = planes_of(np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.float32), 2.5)
    for grid in vars(planes).values():
        np.testing.assert_allclose(grid, 0, atol=1e-4)


def test_rise_is_that_of_the_smoothed_map():
    height = np.sin(COLUMNS / 6) + np.cos(ROWS / 8)
    smooth = cv2.GaussianBlur(height, (0, 0), 3)
    planes = planes_of(height, np.ones(SHAPE, np.float32), 3.0, ridge=1e-4)
    inner = np.s_[12:-12, 12:-12]
    down, right = np.gradient(smooth)
    np.testing.assert_allclose(planes.rise_along_columns[inner], right[inner], atol=0.01)
    np.testing.assert_allclose(planes.rise_along_rows[inner], down[inner], atol=0.01)


@pytest.mark.parametrize('sigma', SIGMAS)
def test_the_ridge_is_a_share_of_the_variance_of_the_gaussian(sigma):
    planes = planes_of(0.3 * COLUMNS, np.ones(SHAPE, np.float32), sigma, ridge=0.5)
    middle = np.s_[25:35, 35:45]
    np.testing.assert_allclose(planes.rise_along_columns[middle], 0.3 / 1.5, rtol=0.03)
    np.testing.assert_allclose(planes.spread[middle], sigma, rtol=0.06)


def test_cells_on_a_diagonal_have_no_spread():
    planes = planes_of(0.3 * COLUMNS, (ROWS == COLUMNS).astype(np.float32), 2.5)
    assert planes.spread[30, 30] == pytest.approx(0, abs=0.01)
