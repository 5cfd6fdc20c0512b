"""The hybrid method on scenes whose obstacles are known, by what it promises and not by its parts.

Limits are well below what is reached: they are to fall when the method breaks, not when it moves.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
import synthetic
import waves
from synthetic import Box, Dome, Pit, Plane, Scene, hazard_camera, iou, mast, pinhole, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.hybrid import slope_beyond_border
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion
from rover_obstacle_detection.detection.regions.regions import nearest_known
from rover_obstacle_detection.detection.result.cue import Cue

BLOCK = (Box(0.0, 1.2, 0.3, 0.3, 0.3),)
DOME = (Dome(-0.3, 1.0, 0.2),)
# As far as these small images measure heights to less than a step.
JUDGED_M = 4.0


def wide_eyes(width=320, height=240, **changes) -> Scene:
    return Scene(pinhole(width, height, 60.0, 0.15), 46.0, 1.0).with_(**changes)


def detect(scene, *, gravity=True, **config):
    view = render(scene)
    known = scene.gravity if gravity else None
    found = Detector(scene.camera, DetectorConfig(**config)).detect(
        view.left, view.right, gravity=known
    )
    return found, view


def apart_deg(one, other) -> float:
    return math.degrees(math.acos(min(1.0, np.dot(one, other))))


def flagged(found, where) -> float:
    return np.count_nonzero(found.mask[where]) / np.count_nonzero(where)


ROCKS = {
    'block': mast(solids=BLOCK),
    'dome': mast(solids=DOME),
    'both': mast(solids=(Box(0.35, 1.4, 0.25, 0.25, 0.22), *DOME)),
    'dark rock': mast(solids=BLOCK, solid_brightness=0.3),
    'rock as bright as the ground': mast(solids=BLOCK, solid_brightness=1.0),
    'close to the ground': hazard_camera(solids=(Dome(0.15, 0.9, 0.18),)),
    'wide eyes': wide_eyes(solids=BLOCK),
    'other centre of the right eye': mast(
        camera=pinhole(320, 240, 60.0, 0.06, offset=6.5), solids=BLOCK
    ),
    'converging eyes': mast(camera=pinhole(320, 240, 60.0, 0.06, offset=-6.5), solids=BLOCK),
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


def test_heights_of_rocks_are_those_above_the_ground():
    found, view = detect(wide_eyes(solids=(Box(0.0, 1.2, 0.4, 0.4, 0.3),)))
    top = np.abs(view.height_m - 0.3) < 1e-6
    assert np.nanmedian(found.height[top]) == pytest.approx(0.3, abs=0.04)
    (rock,) = found.obstacles
    assert rock.max_height_m == pytest.approx(0.3, abs=0.1)
    assert rock.maximum_m[0] - rock.minimum_m[0] == pytest.approx(0.4, abs=0.1)


@pytest.mark.parametrize('height', [0.03, 0.05])
def test_what_the_rover_can_step_on_is_free(height):
    found, _ = detect(wide_eyes(solids=(Box(0.0, 1.0, 0.3, 0.3, height),)))
    assert not found.mask.any()


def test_limit_of_the_step_is_the_rovers():
    scene = wide_eyes(solids=(Box(0.0, 1.0, 0.3, 0.3, 0.2),))
    found, view = detect(scene, max_step=0.1)
    assert flagged(found, view.obstacle) > 0.5
    found, view = detect(scene, max_step=0.3)
    assert flagged(found, view.obstacle) < 0.1


FLAT = {
    **{f'{pitch} degrees': mast(pitch_deg=pitch) for pitch in (20, 30, 46, 60, 75)},
    'close to the ground': hazard_camera(),
    'rolled': mast(roll_deg=10.0),
    'wide eyes': wide_eyes(),
    'other centre of the right eye': mast(camera=pinhole(320, 240, 60.0, 0.06, offset=6.5)),
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
    assert len(found.ground_points) > 0.3 * found.mask.size


@pytest.mark.parametrize('name', ['46 degrees', '60 degrees', 'rolled', 'close to the ground'])
def test_ground_plane_is_found(name):
    scene = FLAT[name]
    found, _ = detect(scene, gravity=False)
    assert found.ground.height_m == pytest.approx(scene.height_m, rel=0.03)
    assert apart_deg(found.ground.normal, scene.gravity.up) < 3.0
    assert apart_deg(found.ground.up, scene.gravity.up) < 0.5


@pytest.mark.parametrize('angle', [15, 26])
def test_vertical_is_that_of_the_ground_before_the_rover(angle):
    scene = wide_eyes(planes=(Plane(), Plane.uphill(angle, start_y=1.6)), pitch_deg=40.0)
    found, view = detect(scene, gravity=False)
    assert (view.height_m > 0.02).mean() > 0.3
    assert apart_deg(found.ground.up, scene.gravity.up) < 2.0


SLOPES = {
    'uphill': lambda angle: Plane.uphill(angle),
    'downhill': lambda angle: Plane.uphill(-angle),
    'to the right': lambda angle: Plane(rise_x=math.tan(math.radians(angle))),
}


@pytest.mark.parametrize('direction', SLOPES)
def test_slope_that_the_rover_climbs_is_free(direction):
    found, view = detect(mast(planes=(SLOPES[direction](12),)))
    assert flagged(found, view.depth_m < JUDGED_M) < 0.01
    assert found.ground.slope_deg == pytest.approx(12, abs=3)


@pytest.mark.parametrize('direction', ['uphill', 'to the right'])
def test_slope_that_is_too_steep_is_an_obstacle(direction):
    found, view = detect(mast(planes=(SLOPES[direction](26),)))
    assert flagged(found, found.disparity > 0) > 0.8
    free, _ = detect(mast(planes=(SLOPES[direction](26),)), max_slope=40.0)
    assert flagged(free, view.depth_m < JUDGED_M) < 0.02


def test_slope_goes_on_where_the_right_eye_does_not_see():
    found, view = detect(mast(planes=(Plane.uphill(26),)))
    strip = ~np.maximum.accumulate(found.disparity > 0, axis=1) & (view.depth_m < JUDGED_M)
    assert strip.mean() > 0.03
    assert flagged(found, strip) > 0.5
    assert found.known[strip & (found.mask > 0)].all()


def test_slope_is_carried_on_only_into_what_the_right_eye_does_not_see():
    camera = pinhole(100, 100, 60.0, 0.1)
    steep = np.zeros((100, 100), bool)
    steep[:40, 20:30] = steep[60:62, 20:30] = True
    measured = np.zeros_like(steep)
    measured[5:, 20:90] = True
    disparity = np.where(measured, 20, 0).astype(np.float32)
    nearest = nearest_known(measured, np.full(steep.shape, 10, np.float32))
    found = slope_beyond_border(steep & measured, nearest, disparity, camera)
    # Not above, where the right eye sees as much, nor beside a speck.
    expected = np.zeros_like(steep)
    expected[5:40, 10:20] = True
    np.testing.assert_array_equal(found[6:39], expected[6:39])
    assert not found[:, 26:].any()
    assert not found[50:].any()
    near = slope_beyond_border(steep & measured, nearest, disparity / 10, camera)
    assert not near[:, 8:].any()


def test_without_gravity_the_ground_in_view_is_level():
    scene = mast(planes=(Plane.uphill(26),))
    found, _ = detect(scene, gravity=False)
    assert flagged(found, found.disparity > 0) < 0.02
    # What the camera is pitched down against the slope is 26 degrees less.
    assert apart_deg(found.ground.up, Gravity.from_angles(46.0 + 26.0).up) < 1.0
    told, _ = detect(scene)
    assert told.ground.up == scene.gravity.up


def test_bank_rising_from_level_ground_is_an_obstacle():
    found, view = detect(wide_eyes(planes=(Plane(), Plane.uphill(35, start_y=1.5))))
    bank = view.height_m > 0.05
    assert 0.2 < bank.mean() < 0.4
    assert flagged(found, bank) > 0.6
    # Smoothing lets the slope begin a little before the bank.
    assert flagged(found, ~bank) < 0.07


@pytest.mark.parametrize('rig', [mast, wide_eyes])
def test_hole_is_found(rig):
    found, view = detect(rig(pits=(Pit(0.0, 1.1, 0.8, 0.8, 0.4),)))
    assert flagged(found, view.obstacle) > 0.7
    assert flagged(found, ~view.obstacle) < 0.1


def test_region_in_the_dark_is_judged_by_its_grey_level():
    """The right eye sees something else where the left eye's patch should be: no 3D there."""
    scene = mast()
    view = render(scene)
    generator = np.random.default_rng(3)
    right = view.right.copy()
    right[90:150, 120:230] = generator.integers(0, 256, (60, 110))
    # With penalties as low as these no disparity is carried into the patch.
    config = DetectorConfig(min_seed_points=100_000, P1=100.0, P2=400.0)
    # The filter may hold a patch with false matches along its edge for a rock, dark or bright.
    detector = Detector(scene.camera, config, leave_out=frozenset({'sight'}))
    inner = np.s_[94:146, 144:226]
    for level, dark in ((8, True), (200, False)):
        left = view.left.copy()
        left[90:150, 140:230] = level + generator.integers(0, 8, (60, 90))
        found = detector.detect(left, right, gravity=scene.gravity)
        without_depth = found.disparity[inner] == 0
        assert without_depth.mean() > 0.5
        by_grey_level = (found.cues[inner][without_depth] & Cue.GREY_LEVEL) > 0
        assert by_grey_level.mean() == pytest.approx(float(dark), abs=0.2)
        assert found.mask[inner][without_depth][by_grey_level].all()


def test_shadow_with_texture_is_free():
    scene = mast(noise=0.7)
    view = render(scene)
    found_in_light = Detector(scene.camera).detect(view.left, view.right)
    # A fifth of the light: darker than the threshold, and matched all the same.
    dim = [np.rint(image * 0.2).astype(np.uint8) for image in (view.left, view.right)]
    assert np.mean(dim[0]) < DetectorConfig().dark_grey_level
    found = Detector(scene.camera).detect(*dim, gravity=scene.gravity)
    assert not found_in_light.mask.any()
    assert flagged(found, view.depth_m < JUDGED_M) < 0.002


def test_small_images_with_eyes_far_apart():
    rig = Scene(pinhole(64, 48, 60.0, 0.3), 46.0, 1.0)
    found, view = detect(rig.with_(solids=(Box(0.1, 1.1, 0.4, 0.4, 0.4),)))
    assert iou(found.mask, view.obstacle) > 0.35
    free, _ = detect(rig)
    assert not free.mask.any()


def test_disparity_is_the_true_one():
    found, view = detect(mast(solids=BLOCK))
    both = (found.disparity > 0) & (view.disparity > 0)
    assert both.mean() > 0.9
    error = np.abs(found.disparity - view.disparity)[both]
    assert np.median(error) < 0.06
    assert np.quantile(error, 0.95) < 0.2


@pytest.mark.parametrize('rows', [-1, 1])
def test_rows_that_are_off_are_put_right(rows):
    scene = mast(640, 480, solids=BLOCK)
    view = render(scene)
    # What the left eye sees in a row the right one sees a row further up or down.
    right = np.roll(view.right, rows, axis=0)
    errors = {}
    for stages in ((), ('rows',)):
        detector = Detector(scene.camera, leave_out=frozenset(stages))
        found = detector.detect(view.left, right, gravity=scene.gravity)
        near = (view.depth_m < JUDGED_M) & (found.disparity > 0)
        assert iou(found.mask, view.obstacle, near) > 0.55
        errors[stages] = np.median(np.abs(found.disparity - view.disparity)[near])
    assert errors[()] < 0.1
    assert errors[()] < 0.5 * errors[('rows',)]


def test_lenses_that_rectification_left_bent_make_no_slope():
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
    for stages in ((), ('lenses',)):
        detector = Detector(camera, leave_out=frozenset(stages))
        found = detector.detect(view.left, right, gravity=scene.gravity)
        matched = near & (found.disparity > 0)
        errors[stages] = np.quantile(np.abs(found.disparity - view.disparity)[matched], 0.9)
        shares[stages] = np.mean(found.cues[near & ~view.obstacle] > 0)
        shapes[stages] = iou(found.mask, view.obstacle, near)
    assert errors[()] < 0.4
    assert errors[('lenses',)] > 1
    assert shares[()] < 0.01
    assert shapes[()] > 0.8


def test_disparity_is_finer_for_the_subpixel_stage():
    scene = mast()
    view = render(scene)
    errors = []
    for stages in ((), ('subpixel',)):
        detector = Detector(scene.camera, leave_out=frozenset(stages))
        found = detector.detect(view.left, view.right, gravity=scene.gravity)
        matched = (found.disparity > 0) & (view.disparity > 0)
        errors.append(np.median(np.abs(found.disparity - view.disparity)[matched]))
    assert errors[0] < 0.05
    assert errors[0] < 0.8 * errors[1]


def test_known_is_what_noise_leaves_to_judge():
    found, _ = detect(mast(solids=BLOCK))
    quiet = np.isfinite(found.height) & (found.height_noise < 0.05)
    assert 0.3 < quiet.mean() < 0.98
    np.testing.assert_array_equal(found.known, quiet | (found.mask > 0))
    careless, _ = detect(mast(solids=BLOCK), max_step=0.2)
    assert careless.known.mean() > found.known.mean()


def test_truth_of_the_scenes_is_right():
    view = synthetic.render(mast(solids=BLOCK))
    camera = view.scene.camera
    # Down the middle column the ground lies where the pitch alone says.
    row = 200
    angle = math.radians(46) + math.atan((row - camera.cy) / camera.fy)
    expected = 1.0 / math.sin(angle) * math.cos(angle - math.radians(46))
    assert view.depth_m[row, 160] == pytest.approx(expected, rel=1e-6)
    assert view.height_m[view.surface == 1].max() == pytest.approx(0.3)


@pytest.mark.parametrize('pitch_deg', [5.0, 15.0, 25.0])
def test_bare_sky_is_no_obstacle_and_gives_no_points(pitch_deg):
    found, view = detect(Scene(pinhole(640, 480, 70.0, 0.12), pitch_deg, 0.6))
    sky = np.isnan(view.depth_m)
    assert sky.mean() > 0.1
    assert flagged(found, sky) < 0.03
    assert flagged(found, ~sky) < 0.01
    assert (found.disparity[sky] > 0).mean() < 0.05


@pytest.mark.parametrize('width', [0.05, 0.08])
def test_a_post_is_an_obstacle_though_no_rock_looks_like_that(width):
    scene = Scene(
        pinhole(640, 480, 60.0, 0.12), 25.0, 1.0, solids=(Box(0.0, 1.8, width, width, 0.5),)
    )
    found, view = detect(scene)
    assert flagged(found, view.obstacle) > 0.5
    # It is certain by its height: no doubt of the filter counts.
    assert (found.rock_probability[view.obstacle] == 1).any()
    assert found.obstacles[0].confidence > 0.9
    free = view.obstacle & found.known & (found.mask == 0) & (found.height > 0.25)
    assert np.count_nonzero(free) < 0.1 * np.count_nonzero(view.obstacle)


def test_cues_are_of_what_is_in_the_mask():
    found, _ = detect(mast(solids=BLOCK))
    assert not found.cues[found.mask == 0].any()


@pytest.mark.parametrize('seed', [1, 201])
def test_images_that_do_not_belong_together_are_no_accident(seed):
    generator = np.random.default_rng(seed)
    left, right = generator.integers(0, 256, (2, 240, 320)).astype(np.uint8)
    found = Detector(pinhole(320, 240, 60.0, 0.06)).detect(left, right)
    assert found.mask.shape == (240, 320)


@pytest.mark.parametrize(
    'config',
    [
        {'smoothness': 20.0},
        {'P1': 20000.0, 'P2': 40000.0},
        {'uniqueness_ratio': 99.0},
        {'max_step': 0.01, 'max_range': 1000.0},
    ],
    ids=str,
)
def test_extreme_parameters_neither_crash_nor_lose_all_matches(config):
    found, view = detect(mast(), **config)
    if 'uniqueness_ratio' not in config:
        assert np.count_nonzero(found.disparity) > 0.5 * found.mask.size
    assert found.mask.shape == view.depth_m.shape
