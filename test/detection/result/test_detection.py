from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.result.detection import FREE, OBSTACLE, Detection

CAMERA = StereoCamera(4, 2, 10.0, 10.0, 1.0, 1.0, 0.5)
UP = (0.0, -1.0, 0.0)


def detection(**products):
    arrays = {
        'grey': np.full((2, 4), 100, np.uint8),
        'disparity': np.array([[5, 5, 0, 5], [5, 5, 2.5, 5]], np.float32),
        'height': np.array([[0.2, 0.1, 0.3, np.nan], [0, 0, 0.5, 0]], np.float32),
        'height_noise': np.full((2, 4), 0.02, np.float32),
        'cues': np.array([[1, 0, 8, 8], [0, 0, 1, 0]], np.uint8),
        'known': np.array([[1, 1, 1, 1], [1, 1, 1, 0]], np.bool_),
        'mask': np.array([[255, 0, 255, 255], [0, 0, 255, 0]], np.uint8),
    }
    return Detection(CAMERA, DetectorConfig(), GroundPlane(UP, 1.0, UP), {**arrays, **products})


def test_levels_of_the_mask():
    assert (FREE, OBSTACLE) == (0, 255)


def test_obstacle_points_are_those_with_depth_and_height_row_by_row():
    found = detection()
    np.testing.assert_allclose(
        found.obstacle_points,
        [
            [-0.1, -0.1, 1.0, 0.2, found.confidence[0, 0]],
            [0.2, 0.0, 2.0, 0.5, found.confidence[1, 2]],
        ],
        atol=1e-6,
    )


def test_unknown_pixels_are_not_obstacle_points():
    known = np.ones((2, 4), bool)
    known[1, 2] = False
    (point,) = detection(known=known).obstacle_points
    assert point[:4] == pytest.approx([-0.1, -0.1, 1.0, 0.2])


def test_each_pixel_knows_its_obstacle_and_how_sure_it_is():
    found = detection()
    np.testing.assert_array_equal(found.obstacle_numbers, [[2, 0, 1, 1], [0, 0, 1, 0]])
    large, small = (each.confidence for each in found.obstacles)
    assert 0 < small < 1
    assert 0 < large < 1
    assert small != large
    expected = np.array([[small, 0, large, large], [0, 0, large, 0]], np.float32)
    np.testing.assert_array_equal(found.confidence, expected)
    assert found.confidence.dtype == np.float32


def test_unknown_pixels_are_in_no_cloud():
    np.testing.assert_allclose(
        detection().ground_points,
        [[0.0, -0.1, 1.0, 0.1], [-0.1, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        atol=1e-6,
    )


def test_clouds_may_be_empty():
    free = detection(mask=np.zeros((2, 4), np.uint8))
    assert free.obstacle_points.shape == (0, 5)
    assert free.obstacle_points.dtype == np.float32
    assert free.obstacles == ()
    assert not free.confidence.any()


def test_products_are_made_when_asked_for_and_once():
    calls = []

    def roughness():
        calls.append('roughness')
        return np.zeros((2, 4), np.float32)

    found = detection(roughness=roughness)
    assert calls == []
    assert found.roughness is found.roughness
    assert calls == ['roughness']
    with pytest.raises(ValueError, match='read-only'):
        found.roughness[0, 0] = 1


def test_obstacles_carry_height_and_range():
    large, small = detection().obstacles
    assert (large.pixels, small.pixels) == (3, 1)
    assert large.max_height_m == pytest.approx(0.5)
    assert large.range_m == pytest.approx(np.hypot(0.2, 2.0))
    assert small.max_height_m == pytest.approx(0.2)
