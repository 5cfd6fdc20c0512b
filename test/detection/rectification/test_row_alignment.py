from __future__ import annotations

from dataclasses import replace

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


def test_places_in_the_right_image():
    camera = replace(CAMERA, cx_right=0.25)
    disparity = np.float32([[0, 1, 2, 3], [1, 1, 1, 1], [0, 0, 0, 0.5]])
    columns, rows = RowAlignment(0.5, 0.25).places(disparity, camera)
    # The offset of 0.75, and -0.25, 0 and 0.25 that the turn adds.
    np.testing.assert_array_equal(
        columns, [[-0.5, -0.5, -0.5, -0.5], [-1.75, -0.75, 0.25, 1.25], [-1, 0, 1, 1.5]]
    )
    np.testing.assert_array_equal(rows[0], [0.25, 0.5, 0.75, 1])
    np.testing.assert_array_equal(rows[2] - rows[0], 2)
    assert columns.dtype == rows.dtype == np.float32


def test_places_of_a_part():
    alignment = RowAlignment(0.5, 0.25)
    disparity = np.arange(12, dtype=np.float32).reshape(CAMERA.shape)
    whole = alignment.places(disparity, CAMERA)
    part = alignment.places(disparity[1:, 2:], CAMERA, 1, 2)
    for one, other in zip(whole, part, strict=True):
        np.testing.assert_array_equal(one[1:, 2:], other)


def test_largest_row_shift():
    assert RowAlignment(-0.5, 0.0).most_px(CAMERA) == 0.5
    # The principal point is column 1 of 4.
    assert RowAlignment(0.5, 0.25).most_px(CAMERA) == 1.0
    assert RowAlignment(0.5, -0.25).most_px(CAMERA) == 0.75
    assert RowAlignment(0.25, -0.5).most_px(CAMERA) == 0.75


def test_mirrored_images_are_off_by_as_many_rows_the_other_way():
    camera = replace(CAMERA, cy=0.25)
    alignment, columns = RowAlignment(0.5, 0.25), np.arange(4, dtype=np.float32)
    mirrored = alignment.mirrored().rows(camera, columns)
    np.testing.assert_array_equal(mirrored, 2 - alignment.rows(camera, columns)[::-1])
    added = alignment.mirrored().added_disparity(replace(camera, cy=1.75))
    np.testing.assert_array_equal(added, alignment.added_disparity(camera)[::-1])


def test_reduced_images_are_off_by_fewer_rows():
    alignment = RowAlignment(2.0, 0.25)
    assert alignment.reduced(4) == RowAlignment(0.5, 0.25)
    assert alignment.reduced(4).reduced(1 / 4) == alignment
