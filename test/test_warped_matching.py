from __future__ import annotations

import numpy as np
import pytest
import synthetic

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.disparity import Penalties
from rover_obstacle_detection.detection.gravity import GroundPlane
from rover_obstacle_detection.detection.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.warped_matching import (
    CoarseDisparity,
    coarse_disparity,
    residual_range,
    warped_disparity,
)

OWN = Penalties(300, 1200)
CONFIG = DetectorConfig()
ROCK = (synthetic.Box(0.0, 1.2, 0.3, 0.3, 0.3),)


def true_ground(scene):
    up = scene.gravity.up
    return GroundPlane(up, scene.height_m, up)


def expected_disparity(scene):
    plane = DisparityPlane.from_ground(true_ground(scene), scene.camera)
    return np.maximum(plane.disparity(scene.camera), 0)


def errors(found, view):
    valid = (found > 0) & (view.disparity > 0)
    return np.abs(found - view.disparity)[valid], valid


def small_rig(offset=0.0, **changes):
    return synthetic.mast(camera=synthetic.pinhole(200, 150, 60.0, 0.06, offset=offset), **changes)


@pytest.mark.parametrize('offset', [0.0, 7.5, -5.0])
@pytest.mark.parametrize('solids', [(), ROCK])
def test_disparity_is_the_true_one(offset, solids):
    scene = small_rig(offset, solids=solids)
    view = synthetic.render(scene)
    found = warped_disparity(
        view.left, view.right, scene.camera, expected_disparity(scene), (-8, 16), CONFIG, OWN
    )
    assert found.dtype == np.float32
    error, valid = errors(found, view)
    assert valid.mean() > 0.85
    assert np.median(error) < 0.1
    assert np.quantile(error, 0.95) < 0.35


def test_wrong_expectation_is_made_good_by_the_search():
    scene = small_rig()
    view = synthetic.render(scene)
    wrong = expected_disparity(scene) + np.float32(3.0)
    found = warped_disparity(view.left, view.right, scene.camera, wrong, (-8, 16), CONFIG, OWN)
    error, valid = errors(found, view)
    assert valid.mean() > 0.85
    assert np.median(error) < 0.15


def test_nothing_is_matched_outside_the_right_image():
    scene = small_rig()
    view = synthetic.render(scene)
    found = warped_disparity(
        view.left, view.right, scene.camera, expected_disparity(scene), (-8, 16), CONFIG, OWN
    )
    in_right = np.arange(scene.camera.width)[np.newaxis] - view.disparity
    assert not found[in_right < -1].any()
    assert (found[(in_right > 8) & (in_right < 190)] > 0).mean() > 0.95


@pytest.mark.parametrize(
    ('width', 'height', 'coarse'),
    [(1024, 768, (192, 256)), (640, 480, (120, 160)), (320, 240, (120, 160)), (64, 48, (48, 64))],
)
def test_small_images_are_reduced_less(width, height, coarse):
    camera = synthetic.pinhole(width, height, 60.0, 0.06)
    black = np.zeros((height, width), np.uint8)
    found = coarse_disparity(black, black, camera, CONFIG, OWN, 4)
    assert found.disparity.shape == coarse == found.camera.shape
    assert found.reduction == pytest.approx(width / coarse[1])


@pytest.mark.parametrize('offset', [0.0, 7.5])
def test_coarse_disparity_is_in_pixels_of_its_camera(offset):
    scene = synthetic.mast(camera=synthetic.pinhole(320, 240, 60.0, 0.06, offset=offset))
    view = synthetic.render(scene)
    found = coarse_disparity(view.left, view.right, scene.camera, CONFIG, OWN, 2)
    truth = view.disparity.reshape(120, 2, 160, 2).mean(axis=(1, 3)) / 2
    valid = found.disparity > 0
    assert valid.mean() > 0.7
    assert np.abs(found.disparity - truth)[valid].mean() < 0.2


def coarse_of(residuals):
    """Flat ground expected at 5 px, found at 5 px and the residuals."""
    camera = synthetic.pinhole(40, 30, 60.0, 0.06)
    disparity = np.full(camera.shape, 5.0, np.float32)
    disparity.ravel()[: len(residuals)] += np.asarray(residuals, np.float32)
    return CoarseDisparity(disparity, camera, 4.0), DisparityPlane(0.0, 0.0, 5.0)


def test_search_covers_what_the_coarse_disparity_shows():
    lowest, count = residual_range(*coarse_of([3.0] * 100 + [-2.0] * 100))
    assert lowest <= -2 * 4 - 1
    assert lowest + count > 3 * 4 + 1
    assert count % 16 == 0


def test_search_on_flat_ground_is_narrow():
    lowest, count = residual_range(*coarse_of([]))
    assert lowest < 0 < lowest + count
    assert count == 16


def test_search_without_any_match_is_around_the_plane():
    coarse, plane = coarse_of([])
    coarse.disparity[:] = 0
    lowest, count = residual_range(coarse, plane)
    assert lowest < 0 < lowest + count
    assert count % 16 == 0
