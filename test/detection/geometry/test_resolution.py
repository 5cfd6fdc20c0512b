"""The resolutions at which a pair is measured and outlined follow from the step's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import pinhole

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import (
    RESOLUTIONS,
    ResolutionParameters,
)
from rover_obstacle_detection.detection.geometry.resolution import outline_camera, working_camera

PARAMETERS = ResolutionParameters()
CAMERA = pinhole(2000, 1500, 60.0, 0.12)
STEP_PX = PARAMETERS.step_px


def plane(pitch_deg=46.0, height_m=1.0, roll_deg=0.0):
    up = Gravity.from_angles(pitch_deg, roll_deg).up
    return GroundPlane(up, height_m, up)


def chosen(ground, camera=CAMERA, **parameters):
    return working_camera(camera, ground, replace(PARAMETERS, **parameters))


def depths_m(ground, camera):
    """Depth of the ground along the optical axis at each pixel below the horizon."""
    x, y = camera.rays()
    along = ground.normal[0] * x + ground.normal[1] * y + ground.normal[2]
    return -ground.height_m / along[along < 0]


# Pitch and height of cameras that see the step in more than enough pixels, but not many more.
MIDDLE = [(46.0, 3.0), (35.0, 2.0), (25.0, 1.5), (15.0, 1.2)]


@pytest.mark.parametrize(('pitch_deg', 'height_m'), MIDDLE)
def test_step_has_the_pixels_it_needs_on_three_quarters_of_the_ground(pitch_deg, height_m):
    ground = plane(pitch_deg, height_m)
    found = chosen(ground)
    assert 533 * 400 < found.width * found.height < CAMERA.width * CAMERA.height
    depth_m = depths_m(ground, CAMERA)
    in_range = depth_m[depth_m < PARAMETERS.max_range_m]
    size_px = found.fx * PARAMETERS.max_step_m / in_range
    assert np.mean(size_px > STEP_PX) == pytest.approx(0.75, abs=0.03)


def test_images_are_resampled_not_cropped():
    found = chosen(plane(35.0, 2.0))
    assert found == CAMERA.resized(found.width, found.height)
    assert found.width / found.height == pytest.approx(4 / 3, rel=0.002)
    assert found.baseline_m == CAMERA.baseline_m


def test_lower_step_and_farther_ground_need_more_pixels():
    width = chosen(plane(35.0, 2.0)).width
    assert chosen(plane(35.0, 2.0), max_step_m=0.08).width == pytest.approx(width / 0.8, rel=0.01)
    assert chosen(plane(35.0, 2.4)).width == pytest.approx(width * 1.2, rel=0.01)
    assert chosen(plane(35.0, 2.4), max_step_m=0.12).width == pytest.approx(width, rel=0.01)


def test_a_finer_camera_makes_the_image_no_larger():
    ground = plane(35.0, 2.0)
    finer = chosen(ground, CAMERA.resized(4000, 3000))
    assert finer.shape == pytest.approx(chosen(ground).shape, abs=1)


def test_far_ground_needs_every_pixel():
    assert chosen(plane(10.0, 4.0)) is CAMERA
    assert chosen(plane(46.0, 15.0)) is CAMERA


def test_images_that_would_hardly_become_smaller_stay_as_they_are():
    assert chosen(plane(), scale=0.95) is CAMERA
    assert chosen(plane(), scale=0.94).shape == (1410, 1880)


@pytest.mark.parametrize('height_m', [0.3, 0.5])
def test_near_ground_leaves_as_many_pixels_as_533_x_400(height_m):
    assert chosen(plane(46.0, height_m)).shape == (400, 533)
    wide = chosen(plane(46.0, height_m), pinhole(1920, 800, 60.0, 0.12))
    assert wide.width * wide.height == pytest.approx(533 * 400, rel=0.005)
    assert wide.width / wide.height == pytest.approx(2.4, rel=0.005)


@pytest.mark.parametrize(('width', 'height'), [(533, 400), (320, 240), (640, 360), (64, 48)])
@pytest.mark.parametrize('height_m', [0.3, 5.0])
def test_small_images_stay_as_they_are(width, height, height_m):
    camera = pinhole(width, height, 60.0, 0.12)
    assert chosen(plane(46.0, height_m), camera) is camera


@pytest.mark.parametrize(
    'ground', [plane(-60.0), plane(-31.0, 5.0), plane(5.0, 200.0)], ids=['sky', 'hill', 'abyss']
)
def test_without_ground_in_range_few_pixels_are_enough(ground):
    assert chosen(ground).shape == (400, 533)


def test_ground_beyond_the_range_does_not_count():
    # Half of the view is a plain that reaches to the horizon.
    ground = plane(8.0, 1.2)
    assert chosen(ground, max_range_m=1000.0).width > 1.2 * chosen(ground, max_range_m=9.0).width


@pytest.mark.parametrize('ground', [plane(46.0, 0.3), plane(10.0, 3.0), plane(-60.0)])
def test_a_fixed_scale_counts_whatever_the_ground(ground):
    assert chosen(ground, scale=0.5) == CAMERA.resized(1000, 750)
    assert chosen(ground, scale=0.1) == CAMERA.resized(200, 150)
    assert chosen(ground, scale=1.0) is CAMERA


def test_a_fixed_scale_leaves_enough_to_judge():
    assert chosen(plane(), scale=0.001).shape == (48, 64)
    tiny = pinhole(40, 30, 60.0, 0.12)
    assert chosen(plane(), tiny, scale=0.001) is tiny


def test_offset_of_the_right_camera_does_not_count():
    ground = plane(35.0, 2.0)
    offset = replace(CAMERA, cx_right=CAMERA.cx - 60.0)
    found = chosen(ground, offset)
    assert found.shape == chosen(ground).shape
    assert found.disparity_offset == pytest.approx(60.0 * found.width / CAMERA.width)


def test_a_rolled_camera_sees_the_same_step():
    width = chosen(plane(35.0, 2.0)).width
    assert chosen(plane(35.0, 2.0, roll_deg=15.0)).width == pytest.approx(width, rel=0.05)


@pytest.mark.parametrize(('pitch_deg', 'height_m'), MIDDLE)
def test_outlines_have_more_pixels(pitch_deg, height_m):
    ground = plane(pitch_deg, height_m)
    found = outline_camera(CAMERA, ground, PARAMETERS)
    ratio = PARAMETERS.outline_step_px / PARAMETERS.step_px
    assert found.width == pytest.approx(ratio * chosen(ground).width, rel=0.01)
    assert found == CAMERA.resized(found.width, found.height)


def test_near_ground_is_outlined_in_as_many_pixels_as_640_x_480():
    assert outline_camera(CAMERA, plane(46.0, 0.3), PARAMETERS).shape == (480, 640)
    small = CAMERA.resized(640, 480)
    assert outline_camera(small, plane(46.0, 0.3), PARAMETERS) is small
    assert working_camera(small, plane(46.0, 0.3), PARAMETERS).shape == (400, 533)


@pytest.mark.parametrize('scale', [0.3, 1.0])
@pytest.mark.parametrize('speed', RESOLUTIONS)
def test_at_a_fixed_scale_outlines_have_the_same_pixels(speed, scale):
    parameters = replace(RESOLUTIONS[speed], scale=scale)
    measured, outlined = (
        choose(CAMERA, plane(), parameters) for choose in (working_camera, outline_camera)
    )
    assert measured == outlined
