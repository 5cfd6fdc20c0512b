"""What was measured is brought to the finer resolution of the outlines."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.images.texture import texture_level
from rover_obstacle_detection.detection.methods.measurement import Measurement
from rover_obstacle_detection.detection.methods.outline_view import outline_view
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.brims import find_brims
from rover_obstacle_detection.detection.terrain.level_brims import AllBrims
from rover_obstacle_detection.detection.terrain.terrain import Terrain

FULL = StereoCamera(192, 144, 180.0, 180.0, 95.5, 71.5, 0.1)
SMALL = FULL.resized(64, 48)
FINE = FULL.resized(128, 96)
UP = Gravity.from_angles(40.0).up
GROUND = GroundPlane(UP, 1.0, UP)
ROWS = RowAlignment(0.5, 0.01)
STEP = np.s_[20:30, 24:40]
"""Pixels that were matched one pixel off the ground plane."""
HOLE = np.s_[35:40, 10:20]
"""Pixels without a match."""


def parameters(outlines=FINE, **configured):
    made = DetectorParameters.from_config(DetectorConfig(**configured))
    return replace(
        made,
        resolution=replace(
            made.resolution,
            step_px=0.01,
            outline_step_px=0.01,
            min_pixels=SMALL.width * SMALL.height,
            outline_min_pixels=outlines.width * outlines.height,
        ),
    )


def full_frame():
    random = np.random.default_rng(0)
    left, right = random.integers(0, 255, (2, *FULL.shape), dtype=np.uint8)
    return Frame((left, right), FULL)


def measured(excluded=None, lenses=STRAIGHT_LENSES):
    correction = Correction(ROWS, lenses)
    frame = full_frame().resized(SMALL)
    straight = replace(correction.straightened(frame), excluded=excluded)
    expected = DisparityPlane.from_ground(GROUND, SMALL).disparity(SMALL)
    disparity = expected.copy()
    disparity[STEP] += 1
    disparity[HOLE] = 0
    noise_px = np.linspace(0.1, 0.5, SMALL.width, dtype=np.float32)
    noise_px = np.tile(noise_px, (SMALL.height, 1))
    stereo = Stereo(straight, GROUND, expected, disparity, noise_px, 2.0, 5.0, correction.rows)
    height_m = np.zeros(SMALL.shape, np.float32)
    height_m[STEP], height_m[HOLE] = 0.3, np.nan
    terrain = Terrain(
        height_m,
        np.where(disparity > 0, noise_px, np.float32(np.inf)),
        np.full(SMALL.shape, 1.0, np.float32),
        disparity / np.float32(0.1),
        (),
    )
    brims = AllBrims((find_brims(stereo, parameters().terrain),))
    return Measurement(frame, correction, stereo, terrain, brims, disparity <= 0)


def doubled(array):
    return array.repeat(2, axis=0).repeat(2, axis=1)


def test_at_the_same_resolution_everything_stays_as_it_is():
    given = measured()
    view = outline_view(full_frame(), given, parameters(outlines=SMALL))
    assert view.frame is given.frame
    assert view.correction is given.correction
    assert view.stereo is given.stereo
    assert view.terrain is given.terrain


def test_images_are_those_of_the_full_frame():
    view = outline_view(full_frame(), measured(), parameters())
    expected = full_frame().resized(FINE)
    for frame in (view.frame, view.stereo.frame):
        assert frame.camera == FINE
        np.testing.assert_array_equal(frame.pair, expected.pair)
    assert view.stereo.texture == texture_level(expected.pair[0], parameters().images)


def test_ground_stays_exactly_on_the_plane():
    view = outline_view(full_frame(), measured(), parameters())
    plane = DisparityPlane.from_ground(GROUND, FINE).disparity(FINE)
    np.testing.assert_array_equal(view.stereo.expected, plane)
    off = view.stereo.disparity - plane
    on_ground = np.ones(SMALL.shape, bool)
    on_ground[STEP] = on_ground[HOLE] = False
    np.testing.assert_allclose(off[doubled(on_ground)], 0, atol=1e-4)


def test_what_stands_up_does_so_by_as_many_metres():
    given = measured()
    view = outline_view(full_frame(), given, parameters())
    step = np.zeros(SMALL.shape, bool)
    step[STEP] = True
    # One pixel of the small images are two of the larger ones.
    off = (view.stereo.disparity - view.stereo.expected)[doubled(step)]
    np.testing.assert_allclose(off, 2, atol=1e-4)
    np.testing.assert_array_equal(view.terrain.height_m, doubled(given.terrain.height_m))
    np.testing.assert_array_equal(view.terrain.noise_m, doubled(given.terrain.noise_m))
    np.testing.assert_array_equal(view.terrain.camera_m, doubled(given.terrain.camera_m))
    np.testing.assert_allclose(view.stereo.noise_px, 2 * doubled(given.stereo.noise_px))
    assert view.stereo.grey_noise == given.stereo.grey_noise


def test_scale_of_the_image_is_that_of_the_disparity():
    view = outline_view(full_frame(), measured(), parameters())
    z_m = FINE.depth_m(1) / view.stereo.disparity[5, 5]
    assert view.terrain.pixels_per_metre[5, 5] == pytest.approx(FINE.fx / z_m, rel=1e-5)


def test_what_was_not_matched_is_not_matched():
    view = outline_view(full_frame(), measured(), parameters())
    hole = np.zeros(SMALL.shape, bool)
    hole[HOLE] = True
    np.testing.assert_array_equal(view.stereo.disparity <= 0, doubled(hole))
    np.testing.assert_array_equal(view.terrain.measured, ~doubled(hole))
    np.testing.assert_array_equal(view.terrain.pixels_per_metre == 0, doubled(hole))


def test_masks_become_finer():
    mask = np.random.default_rng(1).random(SMALL.shape) < 0.5
    view = outline_view(full_frame(), measured(), parameters())
    np.testing.assert_array_equal(view.finer(mask), doubled(mask))


def test_excluded_pixels_stay_excluded():
    excluded = np.zeros(SMALL.shape, bool)
    excluded[40:, :30] = True
    view = outline_view(full_frame(), measured(excluded), parameters())
    np.testing.assert_array_equal(view.stereo.frame.excluded, doubled(excluded))
    assert outline_view(full_frame(), measured(), parameters()).stereo.frame.excluded is None


def test_pixels_of_the_rover_are_excluded_at_their_own_resolution():
    rover = np.zeros(FINE.shape, bool)
    rover[71:, 33:90] = True
    # Three times, twice and once the size of what was measured.
    full = replace(full_frame(), excluded=cv2.resize(rover.view(np.uint8), (192, 144)) > 0)
    expected = full.resized(FINE).excluded
    assert expected.sum() == pytest.approx(rover.sum(), rel=0.05)
    view = outline_view(full, measured(), parameters())
    np.testing.assert_array_equal(view.stereo.frame.excluded, expected)
    too_near = np.zeros(SMALL.shape, bool)
    too_near[45:] = True
    view = outline_view(full, measured(too_near), parameters())
    np.testing.assert_array_equal(view.stereo.frame.excluded, expected | doubled(too_near))


def test_no_pixel_lies_nearer_than_the_range():
    nearest_m = 1.2
    assert measured().stereo.disparity.max() > SMALL.disparity_at(nearest_m)
    view = outline_view(full_frame(), measured(), parameters(min_range=nearest_m))
    assert view.stereo.disparity.max() <= FINE.disparity_at(nearest_m)
    unmatched = view.stereo.disparity <= 0
    np.testing.assert_array_equal(np.isnan(view.terrain.height_m), unmatched)
    np.testing.assert_array_equal(np.isinf(view.terrain.noise_m), unmatched)
    assert view.stereo.frame.excluded[-1].all()
    assert not view.stereo.frame.excluded[0].any()


def test_rows_are_off_by_as_much_of_the_image():
    view = outline_view(full_frame(), measured(), parameters())
    assert view.correction.rows == view.stereo.rows == RowAlignment(1.0, 0.01)


def test_images_of_distorting_lenses_are_straightened():
    lenses = Lenses(LensDistortion(-0.3))
    view = outline_view(full_frame(), measured(lenses=lenses), parameters())
    given = full_frame().resized(FINE)
    np.testing.assert_array_equal(view.frame.pair, given.pair)
    expected = view.correction.straightened(given)
    np.testing.assert_array_equal(view.stereo.frame.pair, expected.pair)
    assert (expected.pair[0] != given.pair[0]).any()
    assert view.correction.lenses == lenses
