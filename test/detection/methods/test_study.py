from __future__ import annotations

import numpy as np
import pytest
from synthetic import Box, iou, mast, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.methods.study import match_as_study
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.result.cue import Cue

BLOCK = (Box(0.0, 1.2, 0.3, 0.3, 0.3),)


def detect(scene, left=None, **config):
    # A mean shift of the default radius takes seconds.
    config = DetectorConfig(method='study', **{'mean_shift_spatial_radius': 3.0, **config})
    view = render(scene)
    found = Detector(scene.camera, config).detect(
        view.left if left is None else left, view.right, gravity=scene.gravity
    )
    return found, view


@pytest.mark.parametrize('pitch', [30, 46, 60])
def test_flat_ground_is_free(pitch):
    found, view = detect(mast(pitch_deg=pitch))
    assert (found.mask[view.depth_m < 4] > 0).mean() < 0.01


def test_rock_is_found():
    found, view = detect(mast(solids=BLOCK))
    assert iou(found.mask, view.obstacle) > 0.25
    assert (found.mask[~view.obstacle] > 0).mean() < 0.04


def test_heights_are_over_the_ground_plane():
    found, view = detect(mast(solids=BLOCK))
    top = np.abs(view.height_m - 0.3) < 1e-6
    assert np.nanmedian(found.height[top]) == pytest.approx(0.3, abs=0.05)
    assert np.nanmedian(found.height[~view.obstacle]) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(('max_range', 'is_matched'), [(10.0, True), (9.9, False)])
def test_what_lies_just_at_the_range_is_matched(max_range, is_matched):
    camera = StereoCamera(160, 120, 100.0, 100.0, 79.5, 59.5, 0.4)
    assert camera.depth_m(4.0) == 10.0
    texture = np.random.default_rng(0).integers(0, 255, (120, 164), np.uint8)
    frame = Frame((texture[:, :160], texture[:, 4:]), camera)
    p = DetectorParameters.from_config(DetectorConfig(method='study', max_range=max_range))
    found = match_as_study(frame, p.stereo, p.study)
    assert (found == 4.0).any() == is_matched
    assert found[found > 0].min() >= 4.0


def test_left_border_without_matches_is_as_wide_as_the_disparity_range():
    found, _ = detect(mast())
    assert not found.disparity[:, :46].any()
    assert (found.disparity[:, 50:] > 0).mean() > 0.95
    wider, _ = detect(mast(), disparity_range=64)
    assert not wider.disparity[:, :62].any()


@pytest.mark.parametrize(('level', 'obstacle'), [(8, True), (200, False)])
def test_region_without_3d_is_judged_by_its_grey_level(level, obstacle):
    scene = mast()
    left = render(scene).left.copy()
    # Nothing in the left border has 3D.
    left[100:160, 2:42] = level
    found, _ = detect(scene, left=left)
    inner = np.s_[106:154, 8:36]
    assert not found.disparity[inner].any()
    assert not found.seeds[inner].any()
    assert len(np.unique(found.regions[inner])) == 1
    assert (found.mask[inner] > 0).all() == obstacle
    assert (found.cues[inner] == (Cue.GREY_LEVEL if obstacle else 0)).all()
    # What was neither measured nor dark is unknown, not free.
    assert (found.known[inner] == obstacle).all()


def test_only_measured_pixels_of_a_seed_region_are_known_to_be_free():
    found, _ = detect(mast(pitch_deg=8.0), max_range=100.0)
    free = found.seeds & (found.mask == 0)
    far = (found.disparity > 0) & (found.disparity < 1)
    assert found.known[free & far].all()
    assert (free & far).any()
    assert not found.known[free & (found.disparity == 0)].any()
    assert (free & (found.disparity == 0)).any()


def test_the_rover_has_no_disparity():
    camera = StereoCamera(160, 120, 100.0, 100.0, 79.5, 59.5, 0.4)
    texture = np.random.default_rng(0).integers(0, 255, (120, 164), np.uint8)
    rover = np.zeros((120, 160), bool)
    rover[60:, 100:] = True
    frame = Frame((texture[:, :160], texture[:, 4:]), camera, excluded=rover)
    p = DetectorParameters.from_config(DetectorConfig(method='study'))
    found = match_as_study(frame, p.stereo, p.study)
    assert found[:60, 100:].all()
    assert not found[rover].any()


def test_a_grey_level_threshold_of_zero_finds_nothing():
    scene = mast()
    left = render(scene).left.copy()
    left[100:160, 2:42] = 0
    found, _ = detect(scene, left, dark_grey_level=0)
    assert not found.mask[:, :46].any()


def test_only_seed_regions_are_judged_by_their_points():
    found, _ = detect(mast(solids=BLOCK), min_seed_points=100_000)
    assert not found.seeds.any()
    assert not found.mask.any()
    assert not found.known.any()


def test_limits_decide_what_is_found():
    scene = mast(solids=BLOCK)
    tight, _ = detect(scene, study_max_step=0.002)
    loose, _ = detect(scene, study_max_step=0.5, study_max_roughness=0.5)
    assert tight.mask.any()
    assert not loose.mask.any()


def test_morphology_removes_specks():
    scene = mast(solids=BLOCK)
    rough, _ = detect(scene, morphology_iterations=0)
    smooth, _ = detect(scene)
    assert len(smooth.obstacles) < len(rough.obstacles)
    assert min(each.pixels for each in smooth.obstacles) > 20


def test_nothing_nearer_than_the_range_is_judged():
    everything, view = detect(mast(solids=BLOCK))
    found, _ = detect(mast(solids=BLOCK), min_range=1.35)
    near = everything.points[..., 2] < 1.349
    assert near.mean() > 0.1
    assert everything.mask[near].any()
    assert not found.mask[near].any()
    assert not found.known[near].any()
    assert not found.disparity[near].any()
    assert found.ground_points[:, 2].min() > 1.349
    assert found.known[view.depth_m > 1.4].mean() > 0.8
