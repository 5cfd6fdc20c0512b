"""What the hybrid method does not judge: pixels that are unknown, and pairs that are refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hybrid_runs import BLOCK, detect, flagged
from synthetic import Scene, hazard_camera, mast, pinhole, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.errors import UnjudgeablePairError


def test_patch_without_3d_is_unknown():
    """The right image shows noise in place of the patch, so that nothing matches there."""
    scene = mast()
    view = render(scene)
    generator = np.random.default_rng(3)
    right = view.right.copy()
    right[90:150, 120:230] = generator.integers(0, 256, (60, 110))
    # Low penalties keep disparities from spreading into the patch.
    config = DetectorConfig(P1=100.0, P2=400.0)
    inner = np.s_[94:146, 144:226]
    for level in (8, 200):
        left = view.left.copy()
        left[90:150, 140:230] = level + generator.integers(0, 8, (60, 90))
        found = Detector(scene.camera, config).detect(left, right, gravity=scene.gravity)
        without_depth = found.disparity[inner] == 0
        assert without_depth.mean() > 0.5
        known, obstacle = found.known[inner][without_depth], found.mask[inner][without_depth] > 0
        np.testing.assert_array_equal(known, obstacle)


def test_pixels_are_known_where_noise_would_not_hide_a_step():
    found, _ = detect(mast(solids=BLOCK))
    quiet = np.isfinite(found.height) & (found.height_noise < 0.05)
    assert 0.3 < quiet.mean() < 0.98
    assert not (found.known & ~quiet & (found.mask == 0)).any()
    obstacle = found.mask > 0
    assert found.known[obstacle].all()
    # What is higher than a step but no obstacle is unknown, and so is what lies behind a brim.
    level = quiet & (np.abs(found.height) < 0.1)
    assert found.known[level].mean() > 0.95
    high = ~obstacle & (np.abs(found.height) > 0.1 + 3 * found.height_noise)
    assert high.any()
    assert not found.known[high].any()
    careless, _ = detect(mast(solids=BLOCK), max_step=0.2)
    assert careless.known.mean() > found.known.mean()


def test_ground_is_free_from_four_pixels_beside_an_obstacle():
    found, _ = detect(mast(solids=BLOCK))
    assert found.mask.any()
    distance_px = cv2.distanceTransform((found.mask == 0).astype(np.uint8), cv2.DIST_L2, 5)
    nearest = distance_px[found.known & (found.mask == 0)].min()
    assert 4 < nearest < 6


@pytest.mark.parametrize('pitch_deg', [5.0, 15.0, 25.0])
def test_bare_sky_is_no_obstacle_and_gives_no_points(pitch_deg):
    found, view = detect(Scene(pinhole(640, 480, 70.0, 0.12), pitch_deg, 0.6))
    sky = np.isnan(view.depth_m)
    assert sky.mean() > 0.1
    assert flagged(found, sky) < 0.03
    assert flagged(found, ~sky) < 0.01
    assert (found.disparity[sky] > 0).mean() < 0.05


@pytest.mark.parametrize('noise', [2.0, 3.0, 4.0, 6.0])
def test_noise_in_the_sky_is_no_obstacle(noise):
    found, view = detect(hazard_camera(noise=noise), gravity=False)
    sky = np.isnan(view.depth_m)
    assert sky.mean() > 0.05
    assert flagged(found, sky) < 0.005


def test_unrelated_images_are_refused():
    left, right = render(mast(solids=BLOCK)).left, render(hazard_camera()).right
    with pytest.raises(UnjudgeablePairError, match='does not belong to the left one'):
        Detector(pinhole(320, 240, 60.0, 0.06)).detect(left, right)


def test_pure_noise_is_refused():
    left, right = np.random.default_rng(1).integers(0, 256, (2, 240, 320)).astype(np.uint8)
    with pytest.raises(UnjudgeablePairError, match='neither image shows any texture'):
        Detector(pinhole(320, 240, 60.0, 0.06)).detect(left, right)


def test_extreme_uniqueness_leaves_no_free_ground_without_3d():
    found, _ = detect(mast(), uniqueness_ratio=99.0)
    assert (found.disparity == 0).any()
    assert not (found.known & (found.disparity == 0) & (found.mask == 0)).any()


# The block lies at 1.23 to 1.44 m along the optical axis, the ground at 0.9 to 3.1 m.
@pytest.mark.parametrize('limit', [{'min_range': 1.35}, {'max_range': 1.3}], ids=str)
def test_nothing_outside_the_range_is_judged(limit):
    everything, _ = detect(mast(solids=BLOCK))
    found, _ = detect(mast(solids=BLOCK), **limit)
    lowest, highest = found.config.min_range, found.config.max_range
    depth_m = everything.points[..., 2]
    outside = (depth_m < 0.98 * lowest) | (depth_m > 1.02 * highest)
    assert flagged(everything, outside) > 0.02, 'a part of the block'
    assert flagged(found, outside) < 1e-3, 'matches differ a little'
    assert found.known[outside].mean() < 1e-3
    measured = found.points[..., 2]
    matched = measured > highest
    assert not (measured < lowest).any()
    assert not found.mask[matched].any()
    assert not found.cues[matched].any()
    assert not found.known[matched].any()
    for cloud in (found.obstacle_points, found.ground_points):
        assert ((cloud[:, 2] >= 0.999 * lowest) & (cloud[:, 2] <= 1.001 * highest)).all()
    inside = everything.known & (depth_m > 1.02 * lowest) & (depth_m < 0.98 * highest)
    assert (found.known[inside]).mean() > 0.9


def test_what_hides_ground_nearer_than_the_range_is_nearer_too():
    found, view = detect(mast(solids=BLOCK), min_range=1.35)
    below = np.arange(found.mask.shape[0]) > 200
    assert (view.depth_m[below] < 1.2).all()
    assert not found.known[below].any()
    assert not found.mask[below].any()
    assert not found.disparity[below].any()
