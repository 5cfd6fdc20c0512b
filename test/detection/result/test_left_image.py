from __future__ import annotations

import cv2
import numpy as np
import pytest
import waves
from hand_made import small_detection
from synthetic import Box, iou, mast, render

from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.result.detection import FREE, OBSTACLE
from rover_obstacle_detection.detection.result.left_image import in_left_image

CAMERA = StereoCamera(60, 40, 50.0, 50.0, 29.5, 19.5, 0.1)
# A pixel 20 px from the optical axis shows what a straight lens would show at 23 px.
PINCHED = Correction(lenses=Lenses(LensDistortion(-0.6)))
LEFT, RIGHT = np.full(CAMERA.shape, 7, np.uint8), np.full(CAMERA.shape, 8, np.uint8)
CORNER, MIDDLE = (0, 0), (20, 30)


def straight_detection(**changes):
    """Everything is a known obstacle."""
    flat = np.zeros(CAMERA.shape, np.float32)
    fields = {
        'grey': np.zeros(CAMERA.shape, np.uint8),
        'disparity': flat + 5,
        'height': flat + 0.3,
        'height_noise': flat + 0.4,
        'rock_probability': flat + 0.5,
        'cues': np.full(CAMERA.shape, 1, np.uint8),
        'known': flat == 0,
        'mask': np.full(CAMERA.shape, OBSTACLE, np.uint8),
        'correction': PINCHED,
    }
    return small_detection(CAMERA, **{**fields, **changes})


def seen(detection, rover_mask=None):
    return in_left_image(detection, Frame((LEFT, RIGHT), CAMERA, excluded=rover_mask))


def test_each_pixel_takes_what_the_straight_image_shows_there():
    columns = np.broadcast_to(np.arange(60, dtype=np.float32), CAMERA.shape).copy()
    found = seen(straight_detection(height=columns))
    radius = (23 * (1 - 0.6 * (23 / 50) ** 2)) / 50
    at = round(29.5 + radius * 50)
    assert at == 50
    assert found.height.dtype == np.float32
    assert found.height[20, 30] == 30
    assert found.height[20, at] == pytest.approx(29.5 + 23, abs=1)


def test_grey_image_is_the_given_left_image():
    found = seen(straight_detection())
    np.testing.assert_array_equal(found.grey, LEFT)
    np.testing.assert_array_equal(found.study.grey, LEFT)


def test_pixels_outside_the_straight_image_are_unknown():
    found = seen(straight_detection())
    for name, outside, inside in (
        ('mask', FREE, OBSTACLE),
        ('cues', 0, 1),
        ('known', False, True),
        ('disparity', 0, 5),
        ('height_noise', np.inf, np.float32(0.4)),
    ):
        assert getattr(found, name)[CORNER] == outside, name
        assert getattr(found, name)[MIDDLE] == inside, name
    for name in ('height', 'rock_probability', 'points', 'roughness', 'step'):
        assert np.isnan(getattr(found, name)[CORNER]).all(), name
    for name in ('height', 'rock_probability', 'points'):
        assert np.isfinite(getattr(found, name)[MIDDLE]).all(), name


def test_points_lie_on_the_straight_rays():
    found = seen(straight_detection())
    depth_m = CAMERA.depth_m(5)
    x, y, z = found.points[20, 50]
    assert z == pytest.approx(depth_m)
    assert x == pytest.approx(23 / 50 * depth_m, rel=0.03)
    assert y == pytest.approx(0.5 / 50 * depth_m, rel=0.2)


def test_rover_is_not_judged():
    rover_mask = np.zeros(CAMERA.shape, np.bool_)
    rover_mask[25:] = True
    found = seen(straight_detection(), rover_mask)
    assert not found.mask[rover_mask].any()
    assert not found.cues[rover_mask].any()
    assert not found.known[rover_mask].any()
    assert found.mask[MIDDLE] == OBSTACLE


def test_given_detection_is_not_modified():
    straight = straight_detection()
    names = ('mask', 'cues', 'known', 'disparity', 'height')
    copies = {name: getattr(straight, name).copy() for name in names}
    seen(straight, np.ones(CAMERA.shape, np.bool_))
    for name, copy in copies.items():
        np.testing.assert_array_equal(getattr(straight, name), copy)


@pytest.mark.parametrize(
    'correction', [Correction(), Correction(lenses=Lenses(right=LensDistortion(-0.6)))]
)
def test_detection_stays_the_same_if_the_left_lens_has_no_distortion(correction):
    straight = straight_detection(correction=correction)
    assert seen(straight) is straight


def test_mask_fits_the_left_image_of_a_distorting_lens():
    scene = mast(640, 480, solids=(Box(-0.7, 1.4, 0.3, 0.3, 0.3),))
    view, camera = render(scene), scene.camera
    lens = LensDistortion(-0.05)
    columns, rows = np.meshgrid(np.arange(640), np.arange(480))
    places = [each.astype(np.float32) for each in waves.straight_left(camera, columns, rows, lens)]
    left = cv2.remap(view.left, *places, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    obstacle = cv2.remap(view.obstacle.astype(np.uint8), *places, cv2.INTER_NEAREST) > 0
    rover_mask = np.zeros(camera.shape, np.bool_)
    rover_mask[440:] = True
    found = Detector(camera, rover_mask=rover_mask).detect(left, view.right, gravity=scene.gravity)
    assert found.lenses.left
    assert iou(found.mask, obstacle) > 0.9
    assert iou(found.mask, view.obstacle) < iou(found.mask, obstacle) - 0.01
    assert not found.mask[440:].any()
    assert not found.known[440:].any()
    np.testing.assert_array_equal(found.grey, left)
    matched = found.disparity > 0
    np.testing.assert_array_equal(np.isfinite(found.points[..., 2]), matched)


@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('k1', [0.06, -0.06])
def test_image_borders_of_a_distorting_lens_make_no_obstacles(side, k1):
    scene = mast(640, 480, solids=(Box(-0.45, 1.2, 0.3, 0.3, 0.3), Box(0.5, 1.8, 0.3, 0.3, 0.3)))
    view, camera = render(scene), scene.camera
    images = {'left': view.left, 'right': view.right}
    where = waves.straight_left if side == 'left' else waves.straight_right
    places = where(camera, *np.meshgrid(np.arange(640), np.arange(480)), LensDistortion(k1))
    images[side] = cv2.remap(
        images[side], *(each.astype(np.float32) for each in places), cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    found = Detector(camera).detect(images['left'], images['right'], gravity=scene.gravity)
    assert found.lenses
    assert len(found.obstacles) == 2
