from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import equalized, grey_pair
from rover_obstacle_detection.errors import ImageError

CAMERA = StereoCamera(4, 3, 10.0, 10.0, 1.5, 1.0, 0.1)


def grey(value=100, dtype=np.uint8, shape=(3, 4)):
    return np.full(shape, value, dtype)


def refusal(left, right):
    with pytest.raises(ImageError) as caught:
        grey_pair(left, right, CAMERA)
    return str(caught.value)


def test_eight_bit_grey_images_are_unchanged():
    left = np.arange(12, dtype=np.uint8).reshape(3, 4)
    found, right = grey_pair(left, grey(7), CAMERA)
    np.testing.assert_array_equal(found, left)
    assert (right == 7).all()
    assert found.dtype == right.dtype == np.uint8


def test_result_is_a_copy_of_the_callers_buffer():
    left, right = grey(10), grey(20)
    found = grey_pair(left, right, CAMERA)
    left[:], right[:] = 99, 99
    assert (found[0] == 10).all()
    assert (found[1] == 20).all()


@pytest.mark.parametrize(
    ('bgr', 'level'),
    [((255, 0, 0), 29), ((0, 255, 0), 150), ((0, 0, 255), 76), ((90, 90, 90), 90)],
)
def test_colour_channels_are_blue_green_red(bgr, level):
    image = np.empty((3, 4, 3), np.uint8)
    image[:] = bgr
    found, _ = grey_pair(image, grey(), CAMERA)
    assert found.shape == (3, 4)
    assert (found == level).all()


@pytest.mark.parametrize(
    ('brightest', 'shift'),
    [(0, 0), (200, 0), (255, 0), (256, 1), (1023, 2), (4095, 4), (65535, 8)],
)
def test_sixteen_bit_images_keep_the_eight_highest_bits_in_use(brightest, shift):
    left = np.linspace(0, brightest, 12).astype(np.uint16).reshape(3, 4)
    found, _ = grey_pair(left, grey(0, np.uint16), CAMERA)
    np.testing.assert_array_equal(found, left >> shift)


def test_both_images_are_shifted_equally():
    left, right = grey_pair(grey(1600, np.uint16), grey(4095, np.uint16), CAMERA)
    assert (left == 100).all()
    assert (right == 255).all()


def test_an_eight_bit_image_needs_no_shift():
    left, right = grey_pair(grey(255), grey(200, np.uint16), CAMERA)
    assert (left == 255).all()
    assert (right == 200).all()


def test_sixteen_bit_colour_is_shifted_too():
    image = np.full((3, 4, 3), 1600, np.uint16)
    found, _ = grey_pair(image, grey(4095, np.uint16), CAMERA)
    assert found.dtype == np.uint8
    assert (found == 100).all()


def test_result_of_strided_images_is_contiguous():
    wide = np.arange(24, dtype=np.uint8).reshape(3, 8)
    found, _ = grey_pair(wide[:, ::2], grey(), CAMERA)
    assert found.flags.c_contiguous
    np.testing.assert_array_equal(found, wide[:, ::2])


@pytest.mark.parametrize('side', ['left', 'right'])
def test_other_sizes_are_rejected_with_both_sizes(side):
    images = {'left': grey(), 'right': grey(), side: grey(shape=(5, 6))}
    message = refusal(images['left'], images['right'])
    assert message == f'{side} image is 6 x 5: the calibration says 4 x 3'


def test_transposed_images_are_rejected():
    assert 'left image is 3 x 4' in refusal(grey(shape=(4, 3)), grey(shape=(4, 3)))


@pytest.mark.parametrize('dtype', [np.float32, np.int16, np.bool_, np.uint32])
def test_other_types_are_rejected(dtype):
    message = refusal(grey(), grey(1, dtype))
    assert message == f'right image has type {np.dtype(dtype)}: expected uint8 or uint16'


@pytest.mark.parametrize('shape', [(3, 4, 1), (3, 4, 2), (3, 4, 4), (12,), (1, 3, 4, 3)])
def test_other_numbers_of_channels_are_rejected(shape):
    message = refusal(grey(shape=shape), grey())
    assert message == f'left image has shape {shape}: expected grey or three channels'


def test_equalization_spreads_the_histogram():
    narrow = np.linspace(100, 120, 12).astype(np.uint8).reshape(3, 4)
    left, right = equalized((narrow, grey(50)))
    assert (left.min(), left.max()) == (0, 255)
    assert (np.diff(left.ravel().astype(int)) >= 0).all()
    assert len(np.unique(right)) == 1


def test_a_missing_image_is_named():
    message = refusal(None, grey())
    assert message.startswith('left image is NoneType: expected an array')
    assert 'cv2.imread' in message
