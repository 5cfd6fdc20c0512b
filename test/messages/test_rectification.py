from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from rover_obstacle_detection.errors import CameraError, ImageError
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.rectification import (
    Rectification,
    StereoRectification,
    needs_rectification,
)

WIDTH, HEIGHT = 160, 120
K = (150.0, 0, 80, 0, 150, 60, 0, 0, 1)
IDENTITY = (1.0, 0, 0, 0, 1, 0, 0, 0, 1)
IDEAL = CameraInfo(
    width=WIDTH,
    height=HEIGHT,
    distortion_model='plumb_bob',
    d=(0.0,) * 5,
    k=K,
    r=IDENTITY,
    p=(150.0, 0, 80, 0, 0, 150, 60, 0, 0, 0, 1, 0),
)
RIGHT = dataclasses.replace(IDEAL, p=(150.0, 0, 80, -15, 0, 150, 60, 0, 0, 0, 1, 0))
TILT = tuple(float(v) for v in cv2.Rodrigues(np.array([0.03, -0.05, 0.02]))[0].reshape(-1))
DISTORTED = dataclasses.replace(IDEAL, d=(-0.25, 0.08, 0.001, -0.002, 0.0), r=TILT)
FISHEYE = dataclasses.replace(
    IDEAL, distortion_model='equidistant', d=(-0.05, 0.01, 0.0, 0.0), r=TILT
)


def raw_image_of_dots(info, points):
    """Draw points of the rectified camera frame as bright dots in the raw image."""
    unrectified = points @ np.reshape(info.r, (3, 3))
    nothing = np.zeros(3)
    if info.distortion_model == 'equidistant':
        pixels = cv2.fisheye.projectPoints(
            unrectified[:, None], nothing, nothing, np.reshape(info.k, (3, 3)), np.array(info.d)
        )[0]
    else:
        pixels = cv2.projectPoints(
            unrectified, nothing, nothing, np.reshape(info.k, (3, 3)), np.array(info.d)
        )[0]
    image = np.zeros((info.height, info.width), np.float32)
    rows, columns = np.mgrid[: info.height, : info.width]
    for column, row in pixels.reshape(-1, 2):
        image += 250 * np.exp(-((columns - column) ** 2 + (rows - row) ** 2) / (2 * 2.0**2))
    return np.minimum(image, 255).astype(np.uint8)


def centroid(image, column, row, radius=8):
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    near = (abs(rows - row) <= radius) & (abs(columns - column) <= radius)
    weights = image * near
    return (weights * columns).sum() / weights.sum(), (weights * rows).sum() / weights.sum()


@pytest.mark.parametrize('info', [DISTORTED, FISHEYE])
def test_rectified_image_shows_points_where_p_projects_them(info):
    points = np.array([[-0.7, -0.4, 2.0], [0.6, 0.5, 2.0], [0.0, 0.1, 3.0]])
    rectified = Rectification(info, '/left/camera_info')(raw_image_of_dots(info, points))
    for x, y, z in points:
        column, row = 150 * x / z + 80, 150 * y / z + 60
        assert centroid(rectified, column, row) == pytest.approx((column, row), abs=0.25)


def test_rectification_honours_binning_and_region_of_interest():
    roi = SimpleNamespace(x_offset=20, y_offset=10, width=100, height=80)
    info = dataclasses.replace(DISTORTED, binning_x=2, binning_y=2, roi=roi)
    point = np.array([[0.1, 0.05, 2.0]])
    raw = raw_image_of_dots(DISTORTED, point)[10:90:2, 20:120:2]
    rectified = Rectification(info, '/left')(raw)
    assert rectified.shape == (40, 50)
    column, row = (150 * 0.05 + 80 - 20) / 2, (150 * 0.025 + 60 - 10) / 2
    assert centroid(rectified, column, row) == pytest.approx((column, row), abs=0.25)


def test_needs_rectification_only_with_distortion_rotation_or_other_intrinsics():
    assert not needs_rectification(IDEAL)
    assert not needs_rectification(RIGHT)
    assert needs_rectification(DISTORTED)
    assert needs_rectification(dataclasses.replace(IDEAL, r=TILT))
    assert needs_rectification(dataclasses.replace(IDEAL, d=(0.1, 0, 0, 0, 0)))
    assert needs_rectification(dataclasses.replace(IDEAL, k=(140.0, *K[1:])))


def test_only_unrectified_images_of_a_pair_change():
    image = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
    nothing = StereoRectification(StereoCalibration(IDEAL, RIGHT, 'yaml'))
    assert not nothing.is_needed
    assert nothing(image, image) == (image, image)
    one = StereoRectification(StereoCalibration(DISTORTED, RIGHT, 'yaml'))
    assert one.is_needed
    left, right = one(image, image)
    assert right is image
    np.testing.assert_array_equal(left, Rectification(DISTORTED, 'yaml')(image))
    assert left.dtype == np.uint8
    assert left.shape == image.shape


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'k': (0.0,) * 9}, 'K is (0.0'),
        ({'k': (float('nan'), *K[1:])}, 'K is (nan'),
        ({'r': (0.0,) * 9}, 'R is (0.0'),
        ({'distortion_model': 'scaramuzza'}, "distortion_model is 'scaramuzza'"),
        ({'d': (0.1, 0.2, 0.3)}, 'D is (0.1, 0.2, 0.3)'),
        ({'d': (float('nan'), 0, 0, 0, 0)}, 'D is (nan, 0, 0, 0, 0): expected finite numbers'),
        ({'d': (0.0,) * 1000}, 'D has 1000 coefficients: expected those of plumb_bob'),
        ({'r': (1e308,) * 9}, 'R is (1e+308, '),
        ({'r': (1.0, 0, 0, 0, 1, 0, 0, 0, -1)}, 'R is (1.0, 0, 0, 0, 1, 0, 0, 0, -1): expected a'),
        ({'k': (150.0, 0, 9000, 0, 150, 60, 0, 0, 1)}, 'with K (150.0, 0, 9000'),
        # In metres, with pixels of 5 micrometres.
        ({'k': (0.00075, 0, 0.0004, 0, 0.00075, 0.0003, 0, 0, 1)}, 'with K (0.00075, 0, 0.0004'),
    ],
)
def test_invalid_calibration_is_refused(changes, words):
    with pytest.raises(CameraError) as caught:
        Rectification(dataclasses.replace(DISTORTED, **changes), '/left/camera_info')
    assert str(caught.value).startswith(f'/left/camera_info: {words}')


def test_image_of_another_size_is_refused():
    with pytest.raises(ImageError, match='is 50 x 40, but its calibration yaml is for 160 x 120'):
        Rectification(DISTORTED, 'yaml')(np.zeros((40, 50), np.uint8))
