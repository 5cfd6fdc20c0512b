from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import synthetic
import waves

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.images.image_noise import image_gradient
from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.rectification.correction import UNCORRECTED, Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.stereo.matching import (
    image_penalties,
    match_against_ground,
)
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.semi_global import Penalties

PARAMETERS = StereoParameters()
IMAGES = ImageParameters()
PENALTIES = Penalties(300, 1200)
SCENE = synthetic.Scene(synthetic.pinhole(200, 150, 60.0, 0.06), 10.0, 1.0, noise=1.0)


def matched(frame, parameters=PARAMETERS, correction=UNCORRECTED):
    up = SCENE.gravity.up
    ground = GroundPlane(up, SCENE.height_m, up)
    return match_against_ground(
        frame, frame.pair, ground, (-8, 16), PENALTIES, correction, parameters
    )


def frame_of(scene=SCENE, **fields):
    view = synthetic.render(scene)
    return Frame((view.left, view.right), scene.camera, **fields), view


def test_ground_is_matched_and_the_bare_sky_is_not():
    frame, view = frame_of()
    expected, found = matched(frame)
    ground = view.surface == synthetic.GROUND
    np.testing.assert_allclose(expected[ground], view.disparity[ground], atol=0.01)
    assert (expected[~ground] <= 0).all()
    valid = ground & (found > 0)
    assert valid.sum() > 0.85 * ground.sum()
    assert np.median(np.abs(found - view.disparity)[valid]) < 0.1
    assert (expected <= 0).sum() > 4000
    assert not found[expected <= 0].any()
    # Without the check for texture, matches are carried into the sky.
    _, carried = matched(frame, replace(PARAMETERS, sky_texture=0.0))
    assert (carried[expected <= 0] > 0).sum() > 100
    np.testing.assert_array_equal(carried[10:][expected[10:] > 2], found[10:][expected[10:] > 2])


def test_matches_without_texture_are_removed_above_the_horizon_only():
    frame, _ = frame_of()
    expected, whole = matched(frame, replace(PARAMETERS, sky_texture=0.0))
    _, found = matched(frame, replace(PARAMETERS, sky_texture=1000.0))
    assert (whole[expected <= 0] > 0).any()
    assert not found[expected <= 0].any()
    far = (expected > 0.2) & (expected < 1)
    assert (whole[far] > 0).sum() > 50
    assert (found[far] > 0).sum() > 0.9 * (whole[far] > 0).sum()


def test_rover_is_not_matched():
    frame, _ = frame_of()
    rover = np.zeros(SCENE.camera.shape, bool)
    rover[130:, 60:140] = True
    _, whole = matched(frame)
    _, found = matched(replace(frame, excluded=rover))
    assert (whole[rover] > 0).mean() > 0.9
    assert not found[rover].any()
    np.testing.assert_array_equal(found[:128], whole[:128])


def test_single_outliers_are_smoothed_away():
    _, found = matched(frame_of(SCENE.with_(noise=6.0))[0])
    ground = found[80:, 20:]
    ring = np.ones((3, 3), np.uint8)
    ring[1, 1] = 0
    outliers = (ground > cv2.dilate(ground, ring)) | (ground < cv2.erode(ground, ring))
    assert (ground > 0).mean() > 0.9
    assert outliers.mean() < 0.005


def test_matches_outside_a_straightened_image_are_removed():
    # The corners of the straightened images lie outside the images themselves.
    correction = Correction(lenses=Lenses(LensDistortion(0.2), LensDistortion(0.2)))
    frame, _ = frame_of()
    expected, found = matched(frame, correction=correction)
    unseen = correction.unseen(np.maximum(expected, 1).astype(np.float32), SCENE.camera)
    _, uncorrected = matched(frame)
    assert (uncorrected[unseen] > 0).sum() > 1000
    assert not correction.unseen(found, SCENE.camera).any()
    assert (found[70:120, 60:140] > 0).mean() > 0.9


def penalties_of(grey, noise_share=0.0, **parameters):
    gradient = image_gradient(grey, IMAGES).overall
    return image_penalties(gradient, noise_share, StereoParameters(**parameters))


def textured(contrast):
    columns, rows = np.meshgrid(np.arange(200), np.arange(150))
    return waves.as_image(waves.texture(columns, rows, contrast=contrast))


def test_penalties_grow_with_contrast_block_noise_and_smoothness():
    plain = penalties_of(textured(10))
    assert 1 < plain.step < plain.jump < PARAMETERS.max_penalty
    crisp = penalties_of(textured(20))
    assert crisp.step == pytest.approx(2 * plain.step, rel=0.1)
    assert crisp.jump == pytest.approx(2 * plain.jump, rel=0.1)
    assert penalties_of(textured(10), block_size_px=5).step == pytest.approx(
        25 / 9 * plain.step, rel=0.01
    )
    assert penalties_of(textured(10), 1.0).step == pytest.approx(4 * plain.step, rel=0.01)
    smoother = penalties_of(textured(10), smoothness=1.5)
    assert smoother.step == pytest.approx(1.5 * plain.step, rel=0.01)


def test_penalties_stay_within_what_sgbm_can_take():
    blank = np.zeros((150, 200), np.uint8)
    assert penalties_of(blank, smoothness=1e-6) == Penalties(1, 2)
    stripes = np.zeros((150, 200), np.uint8)
    stripes[:, ::4] = stripes[:, 1::4] = 255
    most = PARAMETERS.max_penalty
    assert penalties_of(stripes, 1.0, block_size_px=11) == Penalties(most - 1, most)


def test_penalties_of_the_user_are_kept():
    assert penalties_of(textured(10), 1.0, p1=7, p2=70) == Penalties(7, 70)
