"""The hybrid method judges large images at a lower resolution, and answers at their size.

Limits leave a wide margin: they fail when the method breaks, not when it changes a little.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import waves
from hybrid_runs import detect
from synthetic import Box, Dome, iou, mast, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion
from rover_obstacle_detection.detection.result.enlarged import EnlargedDetection

SCENE = mast(1280, 960, solids=(Box(-0.35, 1.0, 0.25, 0.25, 0.2), Dome(0.3, 1.3, 0.18)))
SIZE = SCENE.camera.shape


@cache
def found(working_scale=0.0, speed='accurate'):
    return detect(SCENE, working_scale=working_scale, speed=speed)[0]


def test_near_ground_is_judged_at_a_quarter_of_the_pixels():
    assert isinstance(found(), EnlargedDetection)
    assert found().judged.camera == SCENE.camera.resized(640, 480)
    assert found().camera is SCENE.camera
    assert type(found(1.0)) is not EnlargedDetection
    assert repr(found()).startswith('<Detection 1280 x 960, ')


@pytest.mark.parametrize(('speed', 'pixels'), [('accurate', 640 * 480), ('fast', 480 * 320)])
def test_speed_decides_how_many_pixels_are_judged(speed, pixels):
    judged = found(speed=speed).judged.camera
    assert judged.width * judged.height == pytest.approx(pixels, rel=0.005)
    assert iou(found(speed=speed).mask, render(SCENE).obstacle) > 0.88
    # A fixed scale counts whatever the speed.
    assert found(1.0, speed).mask.tobytes() == found(1.0).mask.tobytes()


def test_outlines_are_finer_than_what_is_measured():
    view = render(SCENE)
    default = DetectorParameters.from_config(DetectorConfig())

    def outlined(width, height):
        resolution = replace(
            default.resolution,
            step_px=1.0,
            min_pixels=240 * 180,
            outline_step_px=1.0,
            outline_min_pixels=width * height,
        )
        detector = Detector(SCENE.camera, parameters=replace(default, resolution=resolution))
        return detector.detect(view.left, view.right, gravity=SCENE.gravity)

    fine, coarse = outlined(640, 480), outlined(240, 180)
    assert (fine.judged.camera.width, coarse.judged.camera.width) == (640, 240)
    assert iou(fine.mask, view.obstacle) > iou(coarse.mask, view.obstacle) + 0.01


def test_mask_agrees_with_the_truth_and_with_that_of_all_pixels():
    view = render(SCENE)
    for each in (found(), found(1.0)):
        assert each.mask.shape == each.known.shape == SIZE
        assert iou(each.mask, view.obstacle) > 0.9
        assert np.mean(each.known[view.obstacle]) > 0.95
    assert iou(found().mask, found(1.0).mask) > 0.9
    assert np.mean(found().known == found(1.0).known) > 0.95


def test_depth_agrees_with_the_truth():
    view = render(SCENE)
    measured = found().disparity > 0
    assert measured.mean() > 0.85
    np.testing.assert_array_equal(np.isfinite(found().points[..., 2]), measured)
    error_m = np.abs(found().points[..., 2] - view.depth_m)[measured]
    assert np.median(error_m) < 0.01
    assert np.median(np.abs(found().disparity - view.disparity)[measured]) < 0.4


def test_obstacles_have_their_boxes_in_the_large_image():
    truth = render(SCENE).surface
    assert len(found().obstacles) == len(found(1.0).obstacles) == 2
    places = []
    for number, each in enumerate(found().obstacles, start=1):
        middle = truth[each.top + each.height // 2, each.left + each.width // 2]
        rows, columns = np.nonzero(truth == middle)
        assert each.left == pytest.approx(columns.min(), abs=12)
        assert each.left + each.width == pytest.approx(columns.max(), abs=12)
        assert each.top == pytest.approx(rows.min(), abs=12)
        assert each.top + each.height == pytest.approx(rows.max(), abs=12)
        assert each.pixels == np.count_nonzero(found().obstacle_numbers == number)
        assert each.max_height_m == pytest.approx(0.2, abs=0.03)
        places.append(middle)
    assert sorted(places) == [1, 2]


def test_clouds_have_at_most_a_point_for_each_judged_pixel():
    judged = found().judged
    obstacle = np.count_nonzero(judged.mask)
    free = np.count_nonzero((judged.mask == 0) & judged.known)
    assert 0.8 * obstacle < len(found().obstacle_points) <= obstacle
    assert 1000 < len(found().ground_points) <= free
    assert np.count_nonzero(found().mask) == pytest.approx(4 * obstacle, rel=0.01)
    # The cloud of all pixels shows the same obstacles.
    for each in (found(), found(1.0)):
        assert np.quantile(each.obstacle_points[:, 3], 0.95) == pytest.approx(0.19, abs=0.03)
    few, all_of_them = (each.obstacle_points[:, :3] for each in (found(), found(1.0)))
    np.testing.assert_allclose(np.median(few, 0), np.median(all_of_them, 0), atol=0.02)


def test_rover_of_the_large_image_is_not_judged():
    view = render(SCENE)
    rover = np.zeros(SIZE, bool)
    rover[801:, 333:951] = True
    seen = Detector(SCENE.camera, rover_mask=rover).detect(
        view.left, view.right, gravity=SCENE.gravity
    )
    assert isinstance(seen, EnlargedDetection)
    assert not seen.mask[rover].any()
    assert not seen.known[rover].any()
    assert found().known[rover].mean() > 0.8
    # Beside it everything is.
    assert iou(seen.mask, view.obstacle & ~rover) > 0.88
    assert seen.known[801:, 960:1270].mean() > 0.9
    assert seen.known[750:799, 333:951].mean() > 0.9


@pytest.mark.parametrize(('width', 'height'), [(640, 480), (600, 450), (1024, 768)])
def test_no_pixel_of_the_rover_is_judged_at_any_size(width, height):
    scene = mast(width, height, solids=SCENE.solids)
    view = render(scene)
    rover = np.zeros(scene.camera.shape, bool)
    rover[height * 5 // 6 + 1 :, 101 : width - 133] = True
    rover[::9, width // 2 :] = True  # an antenna, say
    seen = Detector(scene.camera, rover_mask=rover).detect(
        view.left, view.right, gravity=scene.gravity
    )
    for array in (seen.mask, seen.cues, seen.known, seen.obstacle_numbers):
        assert not array[rover].any()
    assert seen.known[~rover].mean() > 0.6


@pytest.mark.parametrize('width', [640, 1000, 1280])
def test_nothing_outside_the_range_is_judged(width):
    scene = mast(width, width * 3 // 4, solids=SCENE.solids)
    seen, _ = detect(scene, min_range=1.1, max_range=1.5)
    z_m = seen.points[..., 2]
    judged = (seen.known | (seen.mask > 0)) & np.isfinite(z_m)
    assert judged.sum() > 0.01 * judged.size
    assert z_m[judged].min() >= 1.1 - 1e-3
    assert z_m[judged].max() <= 1.5 + 1e-3


def test_mask_fits_the_large_left_image_of_a_distorting_lens():
    view, camera = render(SCENE), SCENE.camera
    lens = LensDistortion(-0.05)
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    places = [each.astype(np.float32) for each in waves.straight_left(camera, columns, rows, lens)]
    left = cv2.remap(view.left, *places, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    obstacle = cv2.remap(view.obstacle.astype(np.uint8), *places, cv2.INTER_NEAREST) > 0
    seen = Detector(camera).detect(left, view.right, gravity=SCENE.gravity)
    assert isinstance(seen, EnlargedDetection)
    assert seen.lenses.left.k1 == pytest.approx(-0.05, abs=0.02)
    assert iou(seen.mask, obstacle) > 0.88
    np.testing.assert_array_equal(seen.grey, left)
    x, y, z = np.moveaxis(seen.points, -1, 0)
    measured = seen.disparity > 0
    # Pixels near the corners show what a straight lens shows 37 px farther out.
    error_px = np.hypot(
        x / z * camera.fx + camera.cx - places[0], y / z * camera.fy + camera.cy - places[1]
    )
    assert np.quantile(error_px[measured], 0.95) < 5


def test_row_misalignment_is_reported_in_pixels_of_the_large_image():
    view = render(SCENE)
    lower = np.roll(view.right, 2, axis=0)
    seen = Detector(SCENE.camera).detect(view.left, lower, gravity=SCENE.gravity)
    assert isinstance(seen, EnlargedDetection)
    assert seen.alignment.offset_px == pytest.approx(2.0, abs=0.2)
    assert iou(seen.mask, view.obstacle) > 0.88
