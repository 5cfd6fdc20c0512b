from __future__ import annotations

import cv2
import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.reprojection import reproject

CAMERA = StereoCamera(8, 6, 50.0, 40.0, 3.0, 2.0, 0.2)


def test_points_follow_the_pinhole_model():
    points = reproject(np.full((6, 8), 5.0, np.float32), CAMERA)
    assert points.shape == (6, 8, 3)
    assert points.dtype == np.float32
    np.testing.assert_allclose(points[2, 3], (0, 0, 2.0))
    np.testing.assert_allclose(points[0, 7], (4 * 2 / 50, -2 * 2 / 40, 2.0), rtol=1e-6)


def test_result_is_that_of_opencv_with_the_right_q_matrix():
    camera = StereoCamera(8, 6, 50.0, 50.0, 3.0, 2.0, 0.2)
    disparity = np.random.default_rng(0).uniform(1, 20, (6, 8)).astype(np.float32)
    q = np.array([[1, 0, 0, -3.0], [0, 1, 0, -2.0], [0, 0, 0, 50.0], [0, 0, 1 / 0.2, 0]])
    np.testing.assert_allclose(
        reproject(disparity, camera), cv2.reprojectImageTo3D(disparity, q), rtol=1e-5, atol=1e-6
    )


def test_pixels_without_a_match_have_no_point():
    disparity = np.full((6, 8), 5.0, np.float32)
    disparity[1, 2], disparity[3, 4] = 0, -1
    points = reproject(disparity, CAMERA)
    missing = np.isnan(points)
    assert missing[1, 2].all()
    assert missing[3, 4].all()
    assert missing.sum() == 6


def test_far_points_have_disparities_below_a_pixel():
    points = reproject(np.full((6, 8), 0.5, np.float32), CAMERA)
    np.testing.assert_allclose(points[..., 2], 20.0)


def test_rays_replace_those_of_the_camera():
    generator = np.random.default_rng(0)
    x_over_z, y_over_z = generator.uniform(-1, 1, (2, 6, 8)).astype(np.float32)
    points = reproject(np.full((6, 8), 5.0, np.float32), CAMERA, (x_over_z, y_over_z))
    np.testing.assert_array_equal(points[..., 2], 2.0)
    np.testing.assert_allclose(points[..., 0], 2 * x_over_z)
    np.testing.assert_allclose(points[..., 1], 2 * y_over_z)
