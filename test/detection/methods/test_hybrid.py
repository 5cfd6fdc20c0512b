"""The hybrid method as a whole, on scenes with known obstacles.

Limits leave a wide margin: they fail when the method breaks, not when it changes a little.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
import waves
from hybrid_runs import BLOCK, detect, flagged
from synthetic import Box, Dome, Pit, Plane, Scene, hazard_camera, iou, mast, pinhole, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion
from rover_obstacle_detection.evaluation.methods.ablation import ABLATIONS

DOME = (Dome(-0.3, 1.0, 0.2),)
# Farther away, these small images do not measure heights to within a step.
JUDGED_M = 4.0


def wide_baseline(width=320, height=240, **changes) -> Scene:
    return Scene(pinhole(width, height, 60.0, 0.15), 46.0, 1.0).with_(**changes)


def apart_deg(one, other) -> float:
    return math.degrees(math.acos(min(1.0, np.dot(one, other))))


def with_and_without(stage):
    return ('with', HYBRID_STAGES), ('without', ABLATIONS[stage])


ROCKS = {
    'block': mast(solids=BLOCK),
    'dome': mast(solids=DOME),
    'both': mast(solids=(Box(0.35, 1.4, 0.25, 0.25, 0.22), *DOME)),
    'dark rock': mast(solids=BLOCK, solid_brightness=0.3),
    'rock as bright as the ground': mast(solids=BLOCK, solid_brightness=1.0),
    'close to the ground': hazard_camera(solids=(Dome(0.15, 0.9, 0.18),)),
    'wide baseline': wide_baseline(solids=BLOCK),
    'diverging cameras': mast(camera=pinhole(320, 240, 60.0, 0.06, offset=6.5), solids=BLOCK),
    'converging cameras': mast(camera=pinhole(320, 240, 60.0, 0.06, offset=-6.5), solids=BLOCK),
    'part of a larger image': mast(
        camera=pinhole(320, 240, 60.0, 0.06, shift=(-20.0, 30.0)), solids=BLOCK
    ),
    'rolled': mast(roll_deg=8.0, solids=BLOCK),
    'odd size': mast(321, 243, solids=BLOCK),
    'on a slope': mast(planes=(Plane.uphill(10),), solids=(Box(0, 1.2, 0.3, 0.3, 0.35, 0.2),)),
}


@pytest.mark.parametrize('gravity', [True, False], ids=['gravity', 'no gravity'])
@pytest.mark.parametrize('name', ROCKS)
def test_rocks_are_found_where_they_are(name, gravity):
    found, view = detect(ROCKS[name], gravity=gravity)
    near = view.depth_m < JUDGED_M
    assert iou(found.mask, view.obstacle, near) > 0.55
    for number in np.unique(view.surface[view.obstacle]):
        assert flagged(found, view.surface == number) > 0.5
    assert flagged(found, near & ~view.obstacle) < 0.02


def test_rocks_have_their_height_and_width():
    found, view = detect(wide_baseline(solids=(Box(0.0, 1.2, 0.4, 0.4, 0.3),)))
    top = np.abs(view.height_m - 0.3) < 1e-6
    assert np.nanmedian(found.height[top]) == pytest.approx(0.3, abs=0.04)
    (rock,) = found.obstacles
    assert rock.max_height_m == pytest.approx(0.3, abs=0.1)
    assert rock.maximum_m[0] - rock.minimum_m[0] == pytest.approx(0.4, abs=0.1)


@pytest.mark.parametrize('height', [0.03, 0.05])
def test_rocks_lower_than_the_step_are_free(height):
    found, _ = detect(wide_baseline(solids=(Box(0.0, 1.0, 0.3, 0.3, height),)))
    assert not found.mask.any()


def test_rover_with_a_larger_step_ignores_the_rock():
    scene = wide_baseline(solids=(Box(0.0, 1.0, 0.3, 0.3, 0.2),))
    found, view = detect(scene, max_step=0.1)
    assert flagged(found, view.obstacle) > 0.5
    found, view = detect(scene, max_step=0.3)
    assert flagged(found, view.obstacle) < 0.1


def test_small_stones_are_rough_ground_only_if_roughness_is_limited():
    stones = [
        Dome(x, y, 0.06) for x in np.arange(-0.6, 0.6, 0.15) for y in np.arange(0.7, 1.6, 0.15)
    ]
    scene = wide_baseline(solids=tuple(stones))
    found, view = detect(scene, max_roughness=0.015)
    assert flagged(found, view.obstacle) > 0.2
    assert {each.kind for each in found.obstacles} == {'rough'}
    free, _ = detect(scene)
    assert not free.mask.any()


FLAT = {
    **{f'{pitch} degrees': mast(pitch_deg=pitch) for pitch in (20, 30, 46, 60, 68)},
    'close to the ground': hazard_camera(),
    'rolled': mast(roll_deg=10.0),
    'wide baseline': wide_baseline(),
    'diverging cameras': mast(camera=pinhole(320, 240, 60.0, 0.06, offset=6.5)),
    'odd size': mast(321, 243),
    'noisy': mast(noise=5.0),
}


@pytest.mark.parametrize('gravity', [True, False], ids=['gravity', 'no gravity'])
@pytest.mark.parametrize('name', FLAT)
def test_flat_ground_is_free(name, gravity):
    found, view = detect(FLAT[name], gravity=gravity)
    near = view.depth_m < JUDGED_M
    assert flagged(found, near) < 0.002
    assert np.count_nonzero(found.known & near) > 0.6 * np.count_nonzero(near)


def test_a_steeper_view_needs_the_vertical_or_a_greater_limit():
    scene = mast(pitch_deg=75.0)
    for options in ({}, {'gravity': False, 'max_camera_pitch': 80.0}):
        found, view = detect(scene, **options)
        assert found.ground.height_m == pytest.approx(1.0, rel=0.03)
        assert flagged(found, view.depth_m < JUDGED_M) < 0.002
        assert found.warnings == ()
    # A wall looks the same, so that nothing is free.
    found, _ = detect(scene, gravity=False)
    assert found.mask[found.disparity > 0].all()
    assert not found.known[found.mask == 0].any()
    (warning,) = found.warnings
    assert 'raise max_camera_pitch or give the vertical' in warning


@pytest.mark.parametrize('name', ['46 degrees', '60 degrees', 'rolled', 'close to the ground'])
def test_ground_plane_is_found(name):
    scene = FLAT[name]
    found, _ = detect(scene, gravity=False)
    assert found.ground.height_m == pytest.approx(scene.height_m, rel=0.03)
    assert apart_deg(found.ground.normal, scene.gravity.up) < 3.0
    assert apart_deg(found.ground.up, scene.gravity.up) < 0.5


@pytest.mark.parametrize('angle', [15, 26])
def test_vertical_is_the_normal_of_the_near_ground(angle):
    scene = wide_baseline(planes=(Plane(), Plane.uphill(angle, start_y=1.6)), pitch_deg=40.0)
    found, view = detect(scene, gravity=False)
    assert (view.height_m > 0.02).mean() > 0.3
    assert apart_deg(found.ground.up, scene.gravity.up) < 2.0


SLOPES = {
    'uphill': lambda angle: Plane.uphill(angle),
    'downhill': lambda angle: Plane.uphill(-angle),
    'to the right': lambda angle: Plane(rise_x=math.tan(math.radians(angle))),
}


@pytest.mark.parametrize('direction', SLOPES)
def test_gentle_slope_is_free(direction):
    found, view = detect(mast(planes=(SLOPES[direction](12),)))
    assert flagged(found, view.depth_m < JUDGED_M) < 0.01
    assert found.ground.slope_deg == pytest.approx(12, abs=3)


@pytest.mark.parametrize('direction', ['uphill', 'to the right'])
def test_steep_slope_is_an_obstacle(direction):
    found, view = detect(mast(planes=(SLOPES[direction](26),)))
    assert flagged(found, found.disparity > 0) > 0.8
    free, _ = detect(mast(planes=(SLOPES[direction](26),)), max_slope=40.0)
    assert flagged(free, view.depth_m < JUDGED_M) < 0.02


def test_slope_continues_where_the_right_image_shows_nothing():
    found, view = detect(mast(planes=(Plane.uphill(26),)))
    strip = ~np.maximum.accumulate(found.disparity > 0, axis=1) & (view.depth_m < JUDGED_M)
    assert strip.mean() > 0.03
    assert flagged(found, strip) > 0.5
    assert found.known[strip & (found.mask > 0)].all()


def test_without_gravity_uniform_ground_is_level():
    scene = mast(planes=(Plane.uphill(26),))
    found, _ = detect(scene, gravity=False)
    assert flagged(found, found.disparity > 0) < 0.02
    assert apart_deg(found.ground.up, Gravity.from_angles(46.0 + 26.0).up) < 1.0
    known, _ = detect(scene)
    assert known.ground.up == scene.gravity.up


def test_bank_rising_from_level_ground_is_an_obstacle():
    found, view = detect(wide_baseline(planes=(Plane(), Plane.uphill(35, start_y=1.5))))
    bank = view.height_m > 0.05
    assert 0.2 < bank.mean() < 0.4
    assert flagged(found, bank) > 0.6
    # Smoothing extends the slope a little in front of the bank.
    assert flagged(found, ~bank) < 0.08


@pytest.mark.parametrize('rig', [mast, wide_baseline])
def test_hole_is_found(rig):
    found, view = detect(rig(pits=(Pit(0.0, 1.1, 0.8, 0.8, 0.4),)))
    assert flagged(found, view.obstacle) > 0.7
    assert flagged(found, ~view.obstacle) < 0.12


def test_textured_shadow_is_free():
    scene = mast(noise=0.7)
    view = render(scene)
    found_in_light = Detector(scene.camera).detect(view.left, view.right)
    # Darker than the threshold, but with texture to match.
    dim = [np.rint(image * 0.2).astype(np.uint8) for image in (view.left, view.right)]
    assert np.mean(dim[0]) < DetectorConfig().dark_grey_level
    found = Detector(scene.camera).detect(*dim, gravity=scene.gravity)
    assert not found_in_light.mask.any()
    assert flagged(found, view.depth_m < JUDGED_M) < 0.002


def test_rock_is_found_in_small_images_with_a_wide_baseline():
    rig = Scene(pinhole(64, 48, 60.0, 0.3), 46.0, 1.0)
    found, view = detect(rig.with_(solids=(Box(0.1, 1.1, 0.4, 0.4, 0.4),)))
    assert iou(found.mask, view.obstacle) > 0.35
    free, _ = detect(rig)
    assert not free.mask.any()


def test_disparity_is_accurate():
    found, view = detect(mast(solids=BLOCK))
    both = (found.disparity > 0) & (view.disparity > 0)
    assert both.mean() > 0.9
    error = np.abs(found.disparity - view.disparity)[both]
    assert np.median(error) < 0.06
    assert np.quantile(error, 0.95) < 0.2


@pytest.mark.parametrize('rows', [-1, 1])
def test_row_shift_is_corrected(rows):
    scene = mast(640, 480, solids=BLOCK)
    view = render(scene)
    right = np.roll(view.right, rows, axis=0)
    errors = {}
    for name, stages in with_and_without('rows'):
        detector = Detector(scene.camera, stages=stages)
        found = detector.detect(view.left, right, gravity=scene.gravity)
        near = (view.depth_m < JUDGED_M) & (found.disparity > 0)
        assert iou(found.mask, view.obstacle, near) > 0.55
        errors[name] = np.median(np.abs(found.disparity - view.disparity)[near])
    assert errors['with'] < 0.1
    assert errors['with'] < 0.5 * errors['without']


def test_lens_distortion_makes_no_slope():
    scene = mast(640, 480, solids=BLOCK)
    view = render(scene)
    camera = scene.camera
    columns, rows = np.meshgrid(np.arange(640), np.arange(480))
    seen = waves.straight_right(camera, columns, rows, LensDistortion(0.0, -0.06))
    right = cv2.remap(
        view.right, *(each.astype(np.float32) for each in seen), cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    near = view.depth_m < JUDGED_M
    errors, shares, shapes = {}, {}, {}
    for name, stages in with_and_without('lenses'):
        found = Detector(camera, stages=stages).detect(view.left, right, gravity=scene.gravity)
        matched = near & (found.disparity > 0)
        errors[name] = np.quantile(np.abs(found.disparity - view.disparity)[matched], 0.9)
        shares[name] = np.mean(found.cues[near & ~view.obstacle] > 0)
        shapes[name] = iou(found.mask, view.obstacle, near)
    assert errors['with'] < 0.4
    assert errors['without'] > 1
    assert shares['with'] < 0.01
    assert shapes['with'] > 0.8


def test_subpixel_refinement_makes_disparity_more_accurate():
    scene = mast()
    view = render(scene)
    errors = {}
    for name, stages in with_and_without('subpixel'):
        detector = Detector(scene.camera, stages=stages)
        found = detector.detect(view.left, view.right, gravity=scene.gravity)
        matched = (found.disparity > 0) & (view.disparity > 0)
        errors[name] = np.median(np.abs(found.disparity - view.disparity)[matched])
    assert errors['with'] < 0.05
    assert errors['with'] < 0.8 * errors['without']


@pytest.mark.parametrize('width', [0.05, 0.08])
def test_post_is_an_obstacle_though_it_does_not_look_like_a_rock(width):
    scene = Scene(
        pinhole(640, 480, 60.0, 0.12), 25.0, 1.0, solids=(Box(0.0, 1.8, width, width, 0.5),)
    )
    found, view = detect(scene)
    assert flagged(found, view.obstacle) > 0.5
    if width == 0.05:
        # The network does not outline it. Its height overrules the network.
        assert (found.rock_probability[view.obstacle] == 1).any()
    assert found.obstacles[0].confidence > 0.9
    free = view.obstacle & found.known & (found.mask == 0) & (found.height > 0.25)
    assert np.count_nonzero(free) < 0.1 * np.count_nonzero(view.obstacle)


def test_grey_and_regions_are_those_of_the_left_image():
    found, view = detect(mast(solids=BLOCK))
    np.testing.assert_array_equal(found.grey, view.left)
    np.testing.assert_array_equal(found.study.grey, view.left)


@pytest.mark.parametrize('gravity', [True, False], ids=['gravity', 'no gravity'])
def test_obstacle_pixels_are_those_with_a_cue(gravity):
    found, _ = detect(mast(solids=BLOCK), gravity=gravity)
    assert found.mask.any()
    np.testing.assert_array_equal(found.cues > 0, found.mask > 0)


@pytest.mark.parametrize(
    'config',
    [
        {'smoothness': 20.0},
        {'P1': 20000.0, 'P2': 40000.0},
        {'max_step': 0.01, 'max_range': 1000.0},
    ],
    ids=str,
)
def test_extreme_parameters_leave_most_of_the_ground_matched(config):
    found, _ = detect(mast(), **config)
    assert np.count_nonzero(found.disparity) > 0.5 * found.mask.size
