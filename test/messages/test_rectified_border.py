"""Raw images that do not fill the rectified ones: what is found in and beside the border."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from synthetic import Box, mast, render

from rover_obstacle_detection import Detector, DetectorConfig
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.rectification import StereoRectification

VIEW = render(mast(solids=(Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
CAMERA = VIEW.scene.camera
# Barrel distortion of a wide-angle lens, rectified to a smaller scale than that of the raw image.
BARREL, RAW_SCALE = (-0.3, 0.09, 0.0, 0.0, 0.0), 1.5
ROLLS = 0.02, -0.02


def camera_info(side):
    fx, fy, cx, cy = CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy
    return CameraInfo(
        width=CAMERA.width,
        height=CAMERA.height,
        distortion_model='plumb_bob',
        d=BARREL,
        k=(RAW_SCALE * fx, 0, cx, 0, RAW_SCALE * fy, cy, 0, 0, 1),
        r=tuple(cv2.Rodrigues(np.array([0, 0, ROLLS[side]]))[0].ravel()),
        p=(fx, 0, cx, -side * fx * CAMERA.baseline_m, 0, fy, cy, 0, 0, 0, 1, 0),
    )


INFOS = camera_info(0), camera_info(1)


def matrices(info):
    return np.reshape(info.k, (3, 3)), np.reshape(info.r, (3, 3)), np.reshape(info.p, (3, 4))


def raw(image, info):
    """What the lens shows of an image without distortion."""
    k, r, p = matrices(info)
    pixels = np.indices(CAMERA.shape)[::-1].reshape(2, -1).T.astype(np.float64)
    places = cv2.undistortPoints(pixels[:, np.newaxis], k, np.array(info.d), R=r, P=p)
    places = places.reshape(*CAMERA.shape, 2).astype(np.float32)
    return cv2.remap(image, places, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def lies_outside(info):
    """Pixels of the rectified image that lie outside the raw one."""
    k, r, _ = matrices(info)
    x, y = np.broadcast_arrays(*CAMERA.rays())
    points = np.stack([x, y, np.ones(x.shape)], axis=-1).reshape(-1, 3) @ r
    nothing = np.zeros(3)
    places = cv2.projectPoints(points, nothing, nothing, k, np.array(info.d))[0].reshape(-1, 2)
    outside = (places < 0) | (places > np.array(CAMERA.shape[::-1]) - 1)
    return outside.any(axis=1).reshape(CAMERA.shape)


def rectified(left=VIEW.left, right=VIEW.right):
    rectify = StereoRectification(StereoCalibration(*INFOS, 'yaml'))
    return rectify(*(raw(each, info) for each, info in zip((left, right), INFOS, strict=True)))


def test_pixels_outside_the_raw_image_are_exactly_black():
    white = np.full(CAMERA.shape, 255, np.uint8)
    for image, info in zip(rectified(white, white), INFOS, strict=True):
        outside = lies_outside(info)
        assert 0.3 < outside.mean() < 0.5
        assert set(np.unique(image)) == {0, 255}
        # Maps have a thirty-second of a pixel.
        assert np.count_nonzero((image == 0) != outside) < 100


@pytest.mark.parametrize('method', ['hybrid', 'study'])
def test_the_empty_border_is_unknown_and_changes_nothing_else(method):
    detector = Detector(CAMERA, DetectorConfig(method=method, mean_shift_spatial_radius=3.0))
    whole = detector.detect(VIEW.left, VIEW.right)
    left, right = rectified()
    found = detector.detect(left, right)
    empty = left == 0
    for array in (found.mask, found.known, found.disparity):
        assert not array[empty].any()
    if method == 'study':
        return
    obstacle, others = VIEW.obstacle & ~empty, ~VIEW.obstacle & (whole.mask == 0)
    assert (found.mask[obstacle] > 0).mean() > (whole.mask[obstacle] > 0).mean() - 0.05
    assert np.count_nonzero(found.mask[others]) < 20
    assert found.known[~empty].mean() > 0.75
    assert found.ground.height_m == pytest.approx(1.0, abs=0.05)
    assert found.ground.pitch_deg == pytest.approx(46.0, abs=1.0)
