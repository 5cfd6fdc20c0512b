"""Which matches the images support."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.parameters import SupportParameters
from rover_obstacle_detection.detection.stereo.support import measure_support, sparse_areas

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
PARAMETERS = SupportParameters()
PLANE = DisparityPlane(0.004, 0.01, 12.0)
TRUTH = PLANE.disparity(CAMERA)
NOISE = 1.0
# Pixels of the left image that are also in the right image.
INNER = np.s_[6:-6, 28:-6]
PATCH = np.s_[60:130, 90:180]


@cache
def pair():
    return waves.stereo_pair(CAMERA, PLANE, noise=NOISE)


def measured(
    images,
    disparity=TRUTH,
    expected=None,
    *,
    camera=CAMERA,
    rows=STRAIGHT,
    parameters=PARAMETERS,
    **fields,
):
    """Support of a disparity; by default, all of it is on the ground plane."""
    disparity = disparity.astype(np.float32)
    expected = disparity if expected is None else expected.astype(np.float32)
    visible = fields.get('visible', np.arange(CAMERA.width) >= TRUTH)
    noise = [
        np.broadcast_to(np.float32(each), 256).copy()
        for each in fields.get('noise', (NOISE, NOISE))
    ]
    return measure_support(images, disparity, expected, camera, rows, visible, noise, parameters)


def patched(images, where, values):
    """The same values in the left image and, so far to the left as the disparity says, right."""
    left, right = (image.copy() for image in images)
    left[where] = values[0]
    right[where[0], where[1].start - 12 : where[1].stop - 12] = values[1]
    return left, right


def grey(where, level=8.0, noise=NOISE, seed=4):
    """A patch that shows nothing but noise, of another kind in each image."""
    shape = where[0].stop - where[0].start, where[1].stop - where[1].start
    generator = np.random.default_rng(seed)
    return [waves.as_image(generator.normal(level, noise, shape)) for _ in range(2)]


def test_texture_that_looks_alike_in_both_images_supports_its_match():
    found = measured(pair())
    assert found.supported[INNER].mean() > 0.99
    assert not found.plain.any()
    assert found.left_textured_share > 0.95
    assert found.right_textured_share > 0.95
    assert found.agreeing_share > 0.97
    assert found.same_share < 0.1


@pytest.mark.parametrize('off_px', [-4, 4, 9])
def test_texture_that_differs_contradicts_the_match(off_px):
    found = measured(pair(), TRUTH + off_px)
    # Windows this small look somewhat alike by chance.
    assert found.supported[INNER].mean() < 0.25
    assert found.agreeing_share < 0.05
    assert found.left_textured_share > 0.95, 'that there is texture has nothing to do with it'


def test_a_wrong_disparity_is_contradicted_where_it_is():
    disparity = TRUTH.copy()
    disparity[PATCH] += 5
    found = measured(pair(), disparity)
    assert found.supported[66:124, 96:174].mean() < 0.15
    beside = np.ones(CAMERA.shape, bool)
    beside[54:136, 84:186] = False
    assert found.supported[INNER][beside[INNER]].mean() > 0.99


def test_without_a_match_nothing_is_supported():
    missing = TRUTH.copy()
    missing[PATCH] = 0
    found = measured(pair(), missing)
    assert not found.supported[PATCH].any()
    assert found.supported[INNER].sum() > 0.99 * np.count_nonzero(missing[INNER])
    # What is matched nowhere does not agree either.
    assert measured(pair(), 0 * TRUTH).agreeing_share == 0


@pytest.mark.parametrize('side', [0, 1])
def test_one_image_may_be_darker_and_have_less_contrast(side):
    images = [image.astype(float) for image in pair()]
    images[side] = 20 + 0.3 * images[side]
    found = measured(tuple(waves.as_image(image) for image in images))
    assert found.supported[INNER].mean() > 0.99
    assert found.agreeing_share > 0.95


def test_the_row_shift_and_the_offset_of_the_camera_are_followed():
    rows = RowAlignment(4.0, 0.03)
    camera = replace(CAMERA, cx_right=CAMERA.cx - 6.0)
    images = waves.stereo_pair(camera, PLANE, rows, noise=NOISE)
    inner = np.s_[12:-12, 40:-12]
    followed = measured(images, camera=camera, rows=rows).supported[inner].mean()
    assert followed > 0.99
    assert measured(images, rows=rows).supported[inner].mean() < 0.3
    assert measured(images, camera=camera).supported[inner].mean() < 0.5


def test_areas_without_texture_are_plain_and_not_supported():
    found = measured(patched(pair(), PATCH, grey(PATCH)))
    assert found.plain[PATCH].all()
    # Matching reaches this far from texture, and no farther.
    assert found.supported[64:68, 96:174].mean() > 0.95
    assert not found.supported[74:116, 104:166].any()
    away = np.ones(CAMERA.shape, bool)
    away[54:136, 84:186] = False
    assert not found.plain[away].any()
    assert found.supported[INNER][away[INNER]].mean() > 0.99


def test_nothing_reaches_from_the_ground_into_the_sky():
    images = patched(pair(), PATCH, grey(PATCH, 200.0))
    assert measured(images).supported[64:68, 96:174].mean() > 0.95
    upper = np.arange(CAMERA.height)[:, np.newaxis] < 140
    sky, far = (np.where(upper, each, TRUTH) for each in (-1, 0.5))
    assert measured(images, expected=sky).supported[64:68, 96:174].mean() < 0.05
    assert measured(images, expected=far).supported[64:68, 96:174].mean() > 0.95


def test_areas_without_a_match_are_not_plain():
    missing = TRUTH.copy()
    missing[50:140, 80:190] = 0
    assert not measured(patched(pair(), PATCH, grey(PATCH)), missing).plain.any()


def test_small_bare_spots_are_not_plain():
    spot = np.s_[80:91, 120:131]
    found = measured(patched(pair(), spot, grey(spot)))
    assert not found.plain.any()
    assert found.supported[spot].mean() > 0.9


def test_faint_texture_is_not_plain():
    generator = np.random.default_rng(7)
    faint = waves.as_image(100 + generator.normal(0, 3, (70, 90)))
    images = [image.copy() for image in patched(pair(), PATCH, (faint, faint))]
    flat = np.full(CAMERA.shape, 12.0)
    assert not measured(images, flat, noise=(NOISE, NOISE)).plain.any()
    # The same is plain if it is no more than noise.
    assert measured(images, flat, noise=(3.5, 3.5)).plain[PATCH].all()


def stripes(period_px, disparity_px, flecks=0.0):
    """Upright stripes that repeat, and flecks that do not, with a disparity of whole pixels."""
    columns, rows = np.meshgrid(np.arange(CAMERA.width + 32), np.arange(CAMERA.height))
    grey = 128 + 40 * np.sin(2 * np.pi * columns / period_px) + 10 * np.sin(rows / 3)
    grey += np.random.default_rng(2).normal(0, flecks, grey.shape)
    return tuple(
        waves.as_image(grey[:, first : first + CAMERA.width], NOISE, seed)
        for seed, first in ((1, 0), (2, disparity_px))
    )


@pytest.mark.parametrize('ground_px', [12, 1])
def test_texture_that_repeats_supports_the_ground_plane_alone(ground_px):
    images = stripes(16, ground_px)
    ground = np.full(CAMERA.shape, float(ground_px))
    on_ground = measured(images, ground, ground)
    assert on_ground.supported[INNER].mean() > 0.99
    above = measured(images, ground + 16, ground)
    inner = np.s_[6:-6, 44:-6]
    assert not above.supported[inner].any()
    # The images agree all the same: no fault of the camera.
    assert above.agreeing_share > 0.8


def test_texture_that_repeats_does_not_support_what_lies_behind_the_ground():
    images = stripes(16, 17)
    behind, ground = np.full(CAMERA.shape, 1.0), np.full(CAMERA.shape, 17.0)
    assert not measured(images, behind, ground).supported[6:-6, 44:-6].any()


def test_repeated_texture_of_a_single_rock_is_compared_where_the_rock_is():
    disparity, ground = np.full(CAMERA.shape, 12.0), np.full(CAMERA.shape, 12.0)
    # Level ground, and stripes that look the same 16 px away.
    images = list(waves.stereo_pair(CAMERA, DisparityPlane(0, 0, 12.0), noise=NOISE))
    for image, whole in zip(images, stripes(16, 12), strict=True):
        image[60:130, 60:200] = whole[60:130, 60:200]
    disparity[80:110, 110:160] += 16
    found = measured(images, disparity, ground)
    assert not found.supported[84:106, 114:156].any()
    assert found.supported[6:60, 28:-6].mean() > 0.99


def test_texture_that_nearly_repeats_supports_the_better_match():
    images = stripes(16, 28, flecks=14.0)
    ground = np.full(CAMERA.shape, 12.0)
    inner = np.s_[6:-6, 44:-6]
    assert measured(images, ground + 16, ground).supported[inner].mean() > 0.95
    assert measured(images, ground, ground).agreeing_share > 0.5, 'it looks alike there, too'


def test_an_object_that_does_not_look_like_the_ground_behind_is_supported():
    images = stripes(16, 20)
    found = measured(images, np.full(CAMERA.shape, 20.0), np.full(CAMERA.shape, 12.0))
    assert found.supported[INNER].mean() > 0.99
    assert found.supported[0, 28:-6].mean() > 0.95, 'up to the edge of the image'


@pytest.mark.parametrize(('away_px', 'supported'), [(2.9, 1.0), (3.1, 0.0)])
def test_matches_near_the_ground_plane_are_not_compared_with_it(away_px, supported):
    # Texture as coarse as this looks the same some pixels away.
    columns, rows = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    image = waves.as_image(128 + 60 * np.sin(rows / 3) + 0 * columns)
    disparity = np.full(CAMERA.shape, 12.0)
    found = measured((image, image), disparity, disparity + away_px)
    assert found.supported[INNER].mean() == pytest.approx(supported, abs=0.01)


def test_texture_is_counted_in_each_whole_image():
    bare = [image.copy() for image in pair()]
    bare[0][:, 120:] = 90
    bare[1][:] = 90
    found = measured(bare, visible=np.zeros(CAMERA.shape, bool))
    assert found.left_textured_share == pytest.approx(0.5, abs=0.05)
    assert found.right_textured_share == 0


def test_agreement_is_that_of_the_visible_texture():
    disparity = TRUTH.copy()
    disparity[:90] += 5
    rows = np.arange(CAMERA.height)[:, np.newaxis] + 0 * np.arange(CAMERA.width)
    seen = np.arange(CAMERA.width) >= TRUTH
    shares = [
        measured(pair(), disparity, visible=visible & seen).agreeing_share
        for visible in (rows < 80, rows >= 100, rows >= 0, rows < 0)
    ]
    assert shares == pytest.approx([0, 1, 0.5, 1], abs=0.05)


def test_noise_is_no_texture():
    flat = np.full(CAMERA.shape, 90.0)
    images = waves.as_image(flat, 2.0, seed=1), waves.as_image(flat, 5.0, seed=2)
    found = measured(images, noise=(2.0, 5.0))
    assert found.left_textured_share < 0.01
    assert found.right_textured_share < 0.01
    assert (found.agreeing_share, found.same_share) == (1, 0), 'nothing to judge them by'
    assert measured(images, noise=(0.3, 0.3)).left_textured_share > 0.95


@pytest.mark.parametrize(('noise', 'least'), [(0.0, 1.0), (0.5, 0.9)])
def test_the_same_image_twice_is_the_same(noise, least):
    left = waves.as_image(pair()[0].astype(float))
    twin = waves.as_image(left.astype(float), noise, seed=6)
    assert measured((left, twin)).same_share >= least


@pytest.mark.parametrize(('difference', 'share'), [(0, 1), (1, 1), (2, 0)])
def test_images_that_differ_by_a_level_are_the_same(difference, share):
    left = np.minimum(pair()[0], np.uint8(250))
    right = left + np.uint8(difference)
    assert measured((left, right)).same_share == share


@pytest.mark.parametrize(('right_level', 'shows'), [(104, False), (105, True)])
def test_texture_must_exceed_noise_by_the_signal(right_level, shows):
    # Noise of 2 levels and a signal of twice that: a variance of 4 + 16, and 4 or 4.5 squared.
    odd = np.indices(CAMERA.shape).sum(axis=0) % 2
    board = np.where(odd, right_level, 96).astype(np.uint8)
    level = np.full(CAMERA.shape, 12.0)
    parameters = replace(PARAMETERS, min_signal=2.0, clear_signal=2.0)
    found = measured((board, board), level, noise=(2.0, 2.0), parameters=parameters)
    assert found.supported[INNER].mean() == shows
    assert found.left_textured_share == found.right_textured_share == shows


def test_plain_areas_are_those_of_the_left_image():
    left, _ = patched(pair(), PATCH, grey(PATCH))
    found = measured((left, pair()[1]))
    assert found.plain[66:124, 96:174].all()
    assert not found.plain[:54].any()


def test_far_matches_of_less_than_a_pixel_are_supported():
    far = DisparityPlane(0, 0, 0.6)
    found = measured(waves.stereo_pair(CAMERA, far, noise=NOISE), far.disparity(CAMERA))
    assert found.supported[6:-6, 6:-6].mean() > 0.99
    assert found.agreeing_share > 0.97


def test_areas_with_few_supported_pixels_are_sparse():
    generator = np.random.default_rng(0)
    shape = 60, 120
    visible = np.ones(shape, np.bool_)
    share = np.where(np.arange(120) < 60, 0.6, 0.97)
    supported = generator.random(shape) < share
    sparse = sparse_areas(supported, visible, SupportParameters())
    assert sparse[:, :45].all()
    assert not sparse[:, 75:].any()


def test_what_cannot_be_visible_makes_no_area_sparse():
    supported = np.zeros((60, 120), np.bool_)
    supported[:, 40:] = True
    visible = np.ones_like(supported)
    assert sparse_areas(supported, visible, SupportParameters())[:, 30:38].all()
    assert not sparse_areas(supported, supported, SupportParameters())[:, 40:].any()
