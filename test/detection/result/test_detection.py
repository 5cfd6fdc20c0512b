from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.result.cue import KIND_NUMBERS, Cue
from rover_obstacle_detection.detection.result.grid import FREE_CELL, OBSTACLE_CELL

CAMERA = StereoCamera(4, 2, 10.0, 10.0, 1.0, 1.0, 0.5)
UP = (0.0, -1.0, 0.0)


def detection(**changes):
    """Two obstacles, of three pixels and of one, and four pixels of ground."""
    fields = {
        'ground': GroundPlane(UP, 1.0, UP),
        'grey': np.full((2, 4), 100, np.uint8),
        'disparity': np.array([[5, 5, 0, 5], [5, 5, 2.5, 5]], np.float32),
        'height': np.array([[0.2, 0.05, 0.3, np.nan], [0, 0, 0.5, 0]], np.float32),
        'height_noise': np.full((2, 4), 0.02, np.float32),
        'cues': np.array([[1, 0, 8, 8], [0, 0, 1, 0]], np.uint8),
        'known': np.array([[1, 1, 1, 1], [1, 1, 1, 0]], np.bool_),
        'mask': np.array([[255, 0, 255, 255], [0, 0, 255, 0]], np.uint8),
    }
    return small_detection(CAMERA, **{**fields, **changes})


def test_obstacle_points_have_depth_and_height_row_by_row():
    found = detection()
    # The third and fourth pixel of the first row have no 3D.
    assert found.obstacle_points.shape == (4, 5)
    np.testing.assert_allclose(
        found.obstacle_points[[0, 3]],
        [
            [-0.1, -0.1, 1.0, 0.2, found.confidence[0, 0]],
            [0.2, 0.0, 2.0, 0.5, found.confidence[1, 2]],
        ],
        atol=1e-6,
    )
    carried = found.obstacle_points[1:3]
    np.testing.assert_allclose(np.linalg.norm(carried[:, :3], axis=1), np.hypot(0.2, 2.0))
    np.testing.assert_allclose(carried[:, :2] / carried[:, 2:3], [[0.1, -0.1], [0.2, -0.1]])
    np.testing.assert_allclose(carried[:, 3], 0.5 - carried[:, 1], atol=1e-6)
    np.testing.assert_allclose(carried[:, 4], found.confidence[0, 2])


def test_a_rim_has_no_point_and_does_not_lengthen_the_box():
    plain = small_detection()
    rim = np.s_[32:34, 30:44]
    disparity, height = plain.disparity.copy(), plain.height.copy()
    disparity[rim], height[rim] = 2.0, 0.0
    found = small_detection(disparity=disparity, height=height)
    assert found.rims.behind[rim].all()
    assert len(found.obstacle_points) == len(plain.obstacle_points) - 28
    assert found.obstacle_points[:, 2].max() == plain.obstacle_points[:, 2].max()
    assert found.obstacles[0].maximum_m[2] == pytest.approx(1.5)
    np.testing.assert_array_equal(found.mask, plain.mask)
    np.testing.assert_array_equal(found.known, plain.known)
    np.testing.assert_array_equal(found.points[rim][..., 2], 3.0)


def test_free_pixels_with_the_depth_of_an_obstacle_are_no_ground_points():
    plain = small_detection()
    rim = np.s_[30:32, 30:44]
    disparity, height = plain.disparity.copy(), plain.height.copy()
    disparity[rim], height[rim] = 4.0, 0.2
    found = small_detection(disparity=disparity, height=height)
    assert len(found.ground_points) == len(plain.ground_points) - 28
    assert (found.ground_points[:, 3] == 0).all()
    np.testing.assert_array_equal(found.obstacle_points[:, :4], plain.obstacle_points[:, :4])


def test_unknown_pixels_are_not_obstacle_points():
    known = np.ones((2, 4), bool)
    known[1, 2] = False
    points = detection(known=known).obstacle_points
    assert points[0, :4] == pytest.approx([-0.1, -0.1, 1.0, 0.2])
    assert not (points[:, 1] == 0).any(), 'nothing in the second row'


def test_ground_points_are_the_known_free_pixels():
    np.testing.assert_allclose(
        detection().ground_points,
        [[0.0, -0.1, 1.0, 0.05], [-0.1, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        atol=1e-6,
    )


def test_each_pixel_has_number_and_confidence_of_its_obstacle():
    found = detection()
    np.testing.assert_array_equal(found.obstacle_numbers, [[2, 0, 1, 1], [0, 0, 1, 0]])
    large, small = (each.confidence for each in found.obstacles)
    assert 0 < small < 1
    assert 0 < large < 1
    assert small != large
    expected = np.array([[small, 0, large, large], [0, 0, large, 0]], np.float32)
    np.testing.assert_array_equal(found.confidence, expected)
    assert found.confidence.dtype == np.float32


def test_free_image_has_empty_clouds():
    free = detection(mask=np.zeros((2, 4), np.uint8))
    assert free.obstacle_points.shape == (0, 5)
    assert free.obstacle_points.dtype == np.float32
    assert free.obstacles == ()
    assert not free.confidence.any()
    assert len(free.ground_points) == 5


def test_obstacles_have_height_and_range():
    large, small = detection().obstacles
    assert (large.pixels, small.pixels) == (3, 1)
    assert large.max_height_m == pytest.approx(0.5)
    assert large.range_m == pytest.approx(np.hypot(0.2, 2.0))
    assert small.max_height_m == pytest.approx(0.2)


def test_obstacles_have_the_kind_of_most_of_their_pixels():
    cues = np.array([[4, 0, 2, 3], [0, 0, 1, 0]], np.uint8)
    assert [each.kind for each in detection(cues=cues).obstacles] == ['rock', 'drop']
    cues = np.array([[16, 0, 2, 2], [0, 0, 1, 0]], np.uint8)
    assert [each.kind for each in detection(cues=cues).obstacles] == ['slope', 'unmeasured']


def test_given_and_computed_arrays_are_read_only():
    found = detection()
    for array in (found.mask, found.cues, found.points, found.confidence, found.obstacle_points):
        with pytest.raises(ValueError, match='read-only'):
            array[0] = 1


def test_points_are_computed_once():
    found = detection()
    assert found.points is found.points


def test_rows_and_lenses_are_those_of_the_correction():
    correction = Correction(RowAlignment(0.4), Lenses(LensDistortion(-0.01)))
    found = dataclasses.replace(detection(), correction=correction)
    assert found.alignment == RowAlignment(0.4)
    assert found.lenses == Lenses(LensDistortion(-0.01))


def test_products_of_the_study_are_offered_by_name():
    found = small_detection()
    assert set(np.unique(found.regions)) == {1, 2}
    for name in ('regions', 'seeds', 'roughness', 'step'):
        assert getattr(found, name) is getattr(found.study, name)


def test_text_of_a_detection_says_what_was_found():
    assert repr(detection(warnings=('dark',))) == (
        '<Detection 4 x 2, hybrid: 2 obstacles, 50.0% obstacle, 12.5% unknown, 1 warning>'
    )


def test_each_obstacle_point_has_the_kind_of_its_pixel():
    cues = np.array([[Cue.DROP, 0, Cue.SLOPE, Cue.HEIGHT], [0, 0, Cue.GREY_LEVEL, 0]], np.uint8)
    kinds = [KIND_NUMBERS[kind] for kind in ('drop', 'slope', 'rock', 'unmeasured')]
    assert detection(cues=cues).obstacle_point_kinds.tolist() == kinds


def test_disparities_below_a_pixel_are_measured():
    far = detection(
        disparity=np.full((2, 4), 0.5, np.float32), height=np.zeros((2, 4), np.float32)
    )
    np.testing.assert_allclose(far.obstacle_points[:, 2], 10.0)
    assert len(far.ground_points) == 3


def test_what_is_low_on_a_rock_gives_no_range_to_others():
    mask = np.array([[0, 0, 255, 255], [0, 0, 255, 255]], np.uint8)
    found = detection(
        mask=mask,
        cues=mask & np.uint8(Cue.HEIGHT),
        known=np.ones((2, 4), bool),
    )
    corner = found.obstacle_points[1, :3]
    assert corner[0] / corner[2] == pytest.approx(0.2)
    assert np.linalg.norm(corner) == pytest.approx(np.hypot(0.2, 2.0)), (
        'not that of the pixel below'
    )


def test_an_obstacle_without_3d_stands_on_the_free_pixels_beside_it():
    plain = small_detection()
    rock = plain.mask > 0
    found = small_detection(disparity=np.where(rock, np.float32(0), plain.disparity))
    # 2 m away, the free pixels lie 1.9 m below the camera, and the plane of the ground 1 m.
    foot = found.obstacle_points[-7]
    assert foot[2] == pytest.approx(2.0, abs=0.1)
    assert foot[3] == pytest.approx(0.0, abs=1e-3)


def test_grid_has_the_obstacle_and_the_free_points():
    cells = small_detection().grid.cells
    assert np.count_nonzero(cells == OBSTACLE_CELL) > 3
    assert np.count_nonzero(cells == FREE_CELL) > 10
