from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hand_made import SCENE, small_detection, stereo_images

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.result.grid import (
    mirrored_grid,
    obstacle_grid,
    unknown_grid,
)

UP = (0.0, -1.0, 0.0)
LEVEL = GroundPlane(UP, 1.5, UP)
NONE = np.zeros((0, 3), np.float32)


def points(*rows):
    return np.array(rows, np.float32)


def grid_of(obstacles=NONE, free=NONE, ground=LEVEL, cell_m=0.5, extent_m=4.0):
    return obstacle_grid(obstacles, free, ground, cell_m, extent_m)


def centre(grid, row, column):
    """Centre of a cell in the optical frame."""
    along, left = (column + 0.5) * grid.cell_m, (row + 0.5) * grid.cell_m
    return grid.origin_m + along * grid.axes[0] + left * grid.axes[1]


def test_axes_of_a_level_camera_are_forward_left_and_up():
    grid = grid_of()
    np.testing.assert_allclose(grid.axes, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-12)
    assert grid.cells.shape == (8, 8)
    assert (grid.cells == -1).all()
    # Two metres to the right, below the camera.
    np.testing.assert_allclose(grid.origin_m, [2.0, 1.5, 0.0], atol=1e-12)


def test_known_points_are_in_known_cells():
    # Optical frame: x right, y down, z forward.
    obstacles = points([-0.7, 1.2, 3.1], [1.9, 1.4, 0.1])
    free = points([0.1, 1.5, 1.1], [-0.1, 1.5, 1.1])
    expected = np.full((8, 8), -1, np.int8)
    expected[5, 6] = expected[0, 0] = 100
    expected[3, 2] = expected[4, 2] = 0
    np.testing.assert_array_equal(grid_of(obstacles, free).cells, expected)


def test_an_obstacle_point_outweighs_free_points():
    free = np.repeat(points([0.1, 1.5, 1.1]), 100, axis=0)
    grid = grid_of(points([0.2, 1.3, 1.2]), free)
    assert grid.cells[3, 2] == 100
    assert np.count_nonzero(grid.cells == -1) == 63


@pytest.mark.parametrize(
    'outside', [[2.1, 1.5, 1.0], [-2.1, 1.5, 1.0], [0.0, 1.5, 4.1], [0.0, 1.5, -0.1]]
)
def test_points_outside_the_grid_are_left_out(outside):
    assert (grid_of(points(outside), points(outside)).cells == -1).all()


def test_height_of_a_point_does_not_move_it():
    low, high = points([-0.7, 1.5, 3.1]), points([-0.7, -4.0, 3.1])
    np.testing.assert_array_equal(grid_of(low).cells, grid_of(high).cells)


@pytest.mark.parametrize('pitch_deg', [0.0, 30.0, 60.0, 89.5, 90.0])
@pytest.mark.parametrize('roll_deg', [-10.0, 0.0, 25.0])
def test_cells_lie_where_their_points_are(pitch_deg, roll_deg):
    up = Gravity.from_angles(pitch_deg, roll_deg).up
    grid = grid_of(ground=GroundPlane(up, 1.2, up))
    np.testing.assert_allclose(grid.axes @ grid.axes.T, np.identity(3), atol=1e-9)
    assert np.linalg.det(grid.axes) == pytest.approx(1)
    for row, column in ((0, 0), (1, 6), (7, 2)):
        place = centre(grid, row, column)
        assert place @ up == pytest.approx(-1.2), 'on the ground'
        seen = grid_of(points(place), ground=GroundPlane(up, 1.2, up))
        assert np.argwhere(seen.cells == 100).tolist() == [[row, column]]


@pytest.mark.parametrize(
    ('pitch_deg', 'roll_deg'), [(40.0, 0.0), (40.0, 20.0), (-10.0, 5.0), (88.0, 20.0)]
)
def test_optical_axis_lies_above_the_grids_middle_line(pitch_deg, roll_deg):
    up = Gravity.from_angles(pitch_deg, roll_deg).up
    axes = grid_of(ground=GroundPlane(up, 1.0, up)).axes
    assert axes[1] @ [0, 0, 1] == pytest.approx(0, abs=1e-9)
    assert axes[0] @ [0, 0, 1] == pytest.approx(math.cos(math.radians(pitch_deg)))


def test_forward_is_the_top_of_the_image_of_a_camera_that_looks_straight_down():
    down = (0.0, 0.0, -1.0)
    axes = grid_of(ground=GroundPlane(down, 1.0, down)).axes
    np.testing.assert_allclose(axes, [[0, -1, 0], [-1, 0, 0], [0, 0, -1]], atol=1e-12)


@pytest.mark.parametrize('slope_deg', [20.0, 80.0])
def test_grid_is_level_at_the_ground_below_the_camera_on_a_slope(slope_deg):
    slope = Gravity.from_angles(slope_deg).up
    grid = grid_of(ground=GroundPlane(slope, 1.0, UP))
    below = grid.origin_m + 4 * grid.cell_m * grid.axes[1]
    np.testing.assert_allclose(below[[0, 2]], 0, atol=1e-12)
    assert below @ slope == pytest.approx(-1.0), 'on the plane of the ground'


@pytest.mark.parametrize(
    ('cell_m', 'extent_m', 'shape'),
    [(0.1, 10.0, (100, 100)), (0.1, 0.3, (4, 3)), (0.3, 1.0, (4, 4)), (10.0, 0.1, (2, 1))],
)
def test_grid_covers_its_extent_in_whole_cells(cell_m, extent_m, shape):
    assert grid_of(cell_m=cell_m, extent_m=extent_m).cells.shape == shape


def test_unknown_grid_has_the_size_of_others():
    grid = unknown_grid(0.5, 4.0)
    assert grid.cells.shape == (8, 8)
    assert (grid.cells == -1).all()
    np.testing.assert_allclose(grid.axes, grid_of().axes)
    np.testing.assert_allclose(grid.origin_m, [2.0, 0.0, 0.0], atol=1e-12)


def test_mirrored_grid_has_the_same_cells_at_the_mirrored_places():
    up = Gravity.from_angles(40.0, 20.0).up
    plane = GroundPlane(up, 1.2, up)
    place = centre(grid_of(ground=plane), 1, 6)
    grid = mirrored_grid(grid_of(points(place), ground=plane))
    np.testing.assert_allclose(grid.axes @ grid.axes.T, np.identity(3), atol=1e-9)
    assert np.linalg.det(grid.axes) == pytest.approx(1)
    ((row, column),) = np.argwhere(grid.cells == 100)
    np.testing.assert_allclose(centre(grid, row, column), place * [1, -1, 1], atol=1e-9)
    assert grid.axes[2] @ (np.asarray(up) * [1, -1, 1]) == pytest.approx(1), 'up is up'


def test_unknown_grid_of_a_camera_upside_down_has_the_left_side_on_the_right():
    grid = unknown_grid(0.5, 4.0, upside_down=True)
    np.testing.assert_allclose(grid.axes, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(grid.origin_m, [-2.0, 0.0, 0.0], atol=1e-12)


def with_grid(ground_cell, **changes):
    config = DetectorConfig(ground_cell=ground_cell, grid_cell=0.05, grid_extent=3.0)
    return small_detection(parameters=DetectorParameters.from_config(config), **changes)


def cells_at(detection, where):
    """Cells that hold these pixels."""
    grid = detection.grid
    place = (detection.points[where].astype(float) - grid.origin_m) @ grid.axes[:2].T
    column, row = (np.floor(each / grid.cell_m).astype(int) for each in place.T)
    rows, columns = grid.cells.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    return np.unique(np.stack((row, column), axis=-1)[inside], axis=0)


def test_grid_of_a_detection_has_all_free_pixels_and_no_other_free_cells():
    dense, thinned = with_grid(0.0), with_grid(2.0)
    assert len(thinned.ground_points) < len(dense.ground_points) / 10
    np.testing.assert_array_equal(thinned.grid.cells, dense.grid.cells)
    obstacle = dense.mask > 0
    hits = {tuple(each) for each in cells_at(dense, obstacle)}
    free = {tuple(each) for each in cells_at(dense, dense.known & ~obstacle)} - hits
    assert {tuple(each) for each in np.argwhere(dense.grid.cells == 100)} == hits
    assert {tuple(each) for each in np.argwhere(dense.grid.cells == 0)} == free
    assert min(len(hits), len(free)) > 10


def test_block_of_a_scene_lies_where_it_stands():
    (block,) = SCENE.solids
    grid = Detector(SCENE.camera).detect(*stereo_images()).grid
    row, column = (np.argwhere(grid.cells == 100) + 0.5).T * grid.cell_m
    left = row - grid.cells.shape[0] * grid.cell_m / 2
    # x of the scene is to the right, y forward; cells of 0.10 m.
    assert np.median(left) == pytest.approx(-block.x, abs=0.1)
    assert np.median(column) == pytest.approx(block.y, abs=0.1)
    assert np.hypot(left + block.x, column - block.y).max() < 0.4
    assert np.count_nonzero(grid.cells == 0) > 500


def test_unknown_pixels_make_no_cell_free():
    plain = with_grid(0.0)
    nothing = with_grid(0.0, known=plain.mask > 0)
    assert np.count_nonzero(plain.grid.cells == 0) > 10
    assert not (nothing.grid.cells == 0).any()
    np.testing.assert_array_equal(nothing.grid.cells == 100, plain.grid.cells == 100)


def test_cells_are_read_only():
    with pytest.raises(ValueError, match='read-only'):
        with_grid(0.0).grid.cells[0] = 0
    with pytest.raises(dataclasses.FrozenInstanceError):
        with_grid(0.0).grid.cell_m = 1
