from __future__ import annotations

import cv2
import numpy as np
import pytest
import waves
from synthetic import Box, iou, mast, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.result.as_seen import as_seen
from rover_obstacle_detection.detection.result.detection import Detection

CAMERA = StereoCamera(60, 40, 50.0, 50.0, 29.5, 19.5, 0.1)
GROUND = GroundPlane((0.0, -1.0, 0.0), 0.5, (0.0, -1.0, 0.0))
# What is seen at 20 px from the axis belongs 23 px from it.
PINCHED = Lenses(LensDistortion(-0.6))
GREY = np.full(CAMERA.shape, 7, np.uint8)


def detection(**products):
    flat = np.zeros(CAMERA.shape, np.float32)
    straight = {
        'grey': np.zeros(CAMERA.shape, np.uint8),
        'disparity': flat + 5,
        'regions': np.arange(flat.size, dtype=np.int32).reshape(flat.shape),
        'seeds': lambda: flat == 0,
        'roughness': lambda: flat + 0.1,
        'step': lambda: flat + 0.2,
        'height': flat + 0.3,
        'height_noise': flat + 0.4,
        'rock_probability': flat + 0.5,
        'cues': np.full(CAMERA.shape, 1, np.uint8),
        'known': lambda: flat == 0,
        'mask': np.full(CAMERA.shape, 255, np.uint8),
    }
    return Detection(CAMERA, DetectorConfig(), GROUND, {**straight, **products})


def test_each_pixel_takes_what_was_found_where_a_straight_lens_shows_it():
    columns = np.broadcast_to(np.arange(60, dtype=np.float32), CAMERA.shape).copy()
    found = as_seen(detection(height=columns, step=lambda: columns), PINCHED, GREY, None)
    radius = (23 * (1 - 0.6 * (23 / 50) ** 2)) / 50
    at = round(29.5 + radius * 50)
    assert at == 50
    row = 20
    for product in (found.height, found.step):
        assert product.dtype == np.float32
        assert product[row, 30] == 30
        assert abs(product[row, at] - (29.5 + 23)) <= 1
    assert found.grey is GREY or np.array_equal(found.grey, GREY)


def test_what_straight_lenses_would_not_show_is_not_known():
    found = as_seen(detection(), PINCHED, GREY, None)
    corner, middle = (0, 0), (20, 30)
    assert found.mask[corner] == 0
    assert found.mask[middle] == 255
    assert found.cues[corner] == 0
    assert found.cues[middle] == 1
    assert not found.known[corner]
    assert found.known[middle]
    assert found.disparity[corner] == 0
    assert found.disparity[middle] == 5
    for name in ('height', 'roughness', 'step', 'rock_probability'):
        assert np.isnan(getattr(found, name)[corner])
        assert np.isfinite(getattr(found, name)[middle])
    assert np.isinf(found.height_noise[corner])
    assert np.isnan(found.points[corner]).all()
    assert found.seeds[corner]
    far_corner = found.regions[39, 59]
    assert far_corner // 60 >= 38
    assert far_corner % 60 >= 58


def test_points_are_where_a_straight_lens_would_have_shown_them():
    found = as_seen(detection(), PINCHED, GREY, None)
    depth_m = CAMERA.depth_m(5)
    x, y, z = found.points[20, 50]
    assert z == pytest.approx(depth_m)
    assert x == pytest.approx(23 / 50 * depth_m, rel=0.03)
    assert y == pytest.approx(0.5 / 50 * depth_m, rel=0.2)


def test_the_rover_is_never_judged():
    rover = np.zeros(CAMERA.shape, np.bool_)
    rover[25:] = True
    found = as_seen(detection(), PINCHED, GREY, rover)
    assert not found.mask[rover].any()
    assert not found.cues[rover].any()
    assert not found.known[rover].any()
    assert found.mask[20, 30] == 255
    assert found.disparity[30, 30] == 5


def test_detection_stays_as_it_is():
    straight = detection()
    before = {name: straight.products[name] for name in ('mask', 'disparity')}
    copies = {name: product.copy() for name, product in before.items()}
    as_seen(straight, PINCHED, GREY, None)
    for name, product in before.items():
        np.testing.assert_array_equal(product, copies[name])


def test_mask_lies_on_what_a_bent_left_lens_shows():
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
    assert found.obstacle_points.shape[1] == 5


@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('k1', [0.06, -0.06])
def test_what_no_eye_saw_makes_no_obstacle(side, k1):
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
