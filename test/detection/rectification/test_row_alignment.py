from __future__ import annotations

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment

CAMERA = StereoCamera(4, 3, 10.0, 10.0, 1.0, 1.0, 0.1)


def test_row_of_a_left_pixel_in_the_right_image():
    rows = RowAlignment(0.5, 0.25).rows(CAMERA, np.array([-1, 1, 5], np.float32))
    assert rows.dtype == np.float32
    np.testing.assert_array_equal(rows, [[0, 0.5, 1.5], [1, 1.5, 2.5], [2, 2.5, 3.5]])
    np.testing.assert_array_equal(
        STRAIGHT.rows(CAMERA, np.zeros(2, np.float32)), [[0, 0], [1, 1], [2, 2]]
    )


def test_disparity_added_by_a_turn():
    np.testing.assert_array_equal(
        RowAlignment(0.5, 0.25).added_disparity(CAMERA), [[-0.25], [0], [0.25]]
    )


def test_largest_row_shift():
    assert RowAlignment(-0.5, 0.0).most_px(CAMERA) == 0.5
    # The principal point is column 1 of 4.
    assert RowAlignment(0.5, 0.25).most_px(CAMERA) == 1.0
    assert RowAlignment(0.25, -0.5).most_px(CAMERA) == 0.75


def test_reduced_images_are_off_by_fewer_rows():
    alignment = RowAlignment(2.0, 0.25)
    assert alignment.reduced(4) == RowAlignment(0.5, 0.25)
    assert alignment.reduced(4).reduced(1 / 4) == alignment
