from __future__ import annotations

from dataclasses import replace

import numpy as np

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity

CAMERA = StereoCamera(6, 4, 5.0, 5.0, 2.5, 1.5, 0.1)
HALF = CAMERA.resized(3, 2)
LEFT = np.array(
    [
        [0, 100, 10, 10, 7, 7],
        [100, 200, 10, 30, 7, 7],
        [0, 0, 40, 40, 255, 255],
        [0, 4, 40, 40, 255, 255],
    ],
    np.uint8,
)
SMALL = [[100, 15, 7], [1, 40, 255]]


def test_each_pixel_is_the_mean_of_those_it_covers():
    found = Frame((LEFT, LEFT[:, ::-1]), CAMERA).resized(HALF)
    assert found.camera is HALF
    for image, expected in zip(found.pair, (SMALL, np.flip(SMALL, 1)), strict=True):
        assert image.dtype == np.uint8
        np.testing.assert_array_equal(image, expected)


def test_pixels_that_are_covered_in_part_count_in_part():
    stripes = np.tile(np.array([0, 90, 0, 0, 90, 0], np.uint8), (4, 1))
    found = Frame((stripes, stripes), CAMERA).resized(CAMERA.resized(4, 4))
    # Pixels of 1.5 columns.
    np.testing.assert_array_equal(found.pair[0], np.tile([30, 30, 30, 30], (4, 1)))


def test_rover_is_what_is_more_than_half_rover():
    mask = np.zeros((4, 6), bool)
    mask[:2, :2] = True
    mask[:2, 2] = True  # half of the second pixel
    mask[2:, 4:] = True
    mask[2, 4] = False  # three quarters of the last
    found = Frame((LEFT, LEFT), CAMERA, excluded=mask).resized(HALF).excluded
    assert found.dtype == np.bool_
    np.testing.assert_array_equal(found, [[True, False, False], [False, False, True]])


def test_gravity_is_kept():
    gravity = Gravity.from_angles(30.0, 2.0, 0.8)
    frame = Frame((LEFT, LEFT), CAMERA, gravity)
    assert frame.resized(HALF).gravity is gravity
    assert frame.resized(HALF).excluded is None


def test_a_frame_of_that_size_stays_as_it_is():
    frame = Frame((LEFT, LEFT), CAMERA, excluded=LEFT > 50)
    assert frame.resized(CAMERA) is frame
    assert frame.resized(CAMERA.resized(6, 4)) is frame


def test_given_images_and_mask_are_not_changed():
    left, mask = LEFT.copy(), LEFT > 50
    for each in (left, mask):
        each.flags.writeable = False
    frame = Frame((left, left), CAMERA, excluded=mask)
    frame.resized(HALF)
    np.testing.assert_array_equal(frame.pair[0], LEFT)
    np.testing.assert_array_equal(frame.excluded, LEFT > 50)
    assert frame.camera is CAMERA


TINY = StereoCamera(4, 3, 10.0, 12.0, 1.0, 0.5, 0.1, cx_right=0.5)


def test_frame_is_mirrored_in_all_its_parts():
    left, right = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    rover = np.array([[1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]], bool)
    frame = Frame((left, right), TINY, Gravity((0.0, 0.6, -0.8), 2.0), rover)

    mirrored = frame.mirrored()

    # Left stays left.
    assert mirrored.pair[0].tolist() == [[8, 9, 10, 11], [4, 5, 6, 7], [0, 1, 2, 3]]
    assert mirrored.pair[1].tolist() == [[20, 21, 22, 23], [16, 17, 18, 19], [12, 13, 14, 15]]
    assert mirrored.camera == replace(TINY, cy=1.5)
    np.testing.assert_array_equal(mirrored.camera.rays()[1], -TINY.rays()[1][::-1])
    np.testing.assert_array_equal(mirrored.camera.rays()[0], TINY.rays()[0])
    assert mirrored.gravity == Gravity((0.0, -0.6, -0.8), 2.0)
    assert mirrored.excluded is not None
    assert mirrored.excluded.tolist() == rover[::-1].tolist()
    without = Frame((left, right), TINY).mirrored()
    assert (without.gravity, without.excluded) == (None, None)
