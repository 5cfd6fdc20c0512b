from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.subpixel import refine_disparity

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
PARAMETERS = StereoParameters()
# Disparity changes by less than a pixel within a window, and by more.
PLANE = DisparityPlane(0.004, 0.01, 12.0)
STEEP = DisparityPlane(0.012, 0.057, 12.0)
# Pixels of the left image that are also in the right image.
INNER = np.s_[6:-6, 28:-6]


def whole_pixels(plane=PLANE):
    return np.rint(plane.disparity(CAMERA))


def refined(pair, disparity=None, camera=CAMERA, rows=STRAIGHT, parameters=PARAMETERS):
    disparity = whole_pixels() if disparity is None else disparity
    refined = refine_disparity(pair, disparity, camera, rows, parameters)
    found, noise_px = refined.disparity, refined.noise_px
    for array in (found, noise_px):
        assert array.dtype == np.float32
        assert array.shape == disparity.shape
        assert np.isfinite(array).all()
    return found, noise_px


def rms(found, plane=PLANE):
    return np.sqrt(np.mean((found - plane.disparity(CAMERA))[INNER] ** 2))


def pulled_to_whole_pixels(plane):
    """Disparity with the error of semi-global matching, largest a quarter from a whole pixel."""
    truth = plane.disparity(CAMERA)
    return (truth - 0.12 * np.sin(2 * np.pi * truth)).astype(np.float32)


@pytest.mark.parametrize(('noise', 'limit'), [(0.0, 0.12), (2.0, 0.13), (5.0, 0.18)])
def test_whole_pixels_are_refined_to_fractions(noise, limit):
    pair = waves.stereo_pair(CAMERA, PLANE, noise=noise)
    assert rms(whole_pixels()) == pytest.approx(12**-0.5, abs=0.03)
    assert rms(refined(pair)[0]) < limit


@pytest.mark.parametrize('noise', [2.0, 5.0])
def test_grey_noise_is_that_of_the_difference_of_both_images(noise):
    pair = waves.stereo_pair(CAMERA, PLANE, noise=noise)
    found = refine_disparity(pair, PLANE.disparity(CAMERA), CAMERA, STRAIGHT, PARAMETERS)
    assert found.grey_noise == pytest.approx(noise * 2**0.5, rel=0.15)


@pytest.mark.parametrize(('noise', 'limit'), [(0.0, 0.05), (2.0, 0.06)])
@pytest.mark.parametrize('plane', [PLANE, STEEP], ids=['flat', 'steep'])
def test_pull_to_whole_pixels_is_removed(plane, noise, limit):
    pulled = pulled_to_whole_pixels(plane)
    assert rms(pulled, plane) == pytest.approx(0.085, abs=0.005)
    found, _ = refined(waves.stereo_pair(CAMERA, plane, noise=noise), pulled)
    assert rms(found, plane) < limit


@pytest.mark.parametrize('slope', [0.15, -0.15])
def test_plane_may_tilt_sideways(slope):
    plane = DisparityPlane(slope, 0.02, 22.0)
    truth = plane.disparity(CAMERA)
    found, _ = refined(waves.stereo_pair(CAMERA, plane), truth + np.float32(0.2))
    inner = np.s_[6:-6, 46:-6]
    assert np.sqrt(np.mean((found - truth)[inner] ** 2)) < 0.07


def test_true_disparity_is_kept():
    truth = PLANE.disparity(CAMERA)
    found, _ = refined(waves.stereo_pair(CAMERA, PLANE), truth)
    assert rms(found) < 0.04
    np.testing.assert_allclose(found[INNER], truth[INNER], atol=0.1)


@pytest.mark.parametrize('off_px', [-0.5, 0.5])
def test_half_a_pixel_of_error_is_removed_despite_weak_texture(off_px):
    pair = waves.stereo_pair(CAMERA, PLANE, contrast=3.0, noise=2.0)
    truth = PLANE.disparity(CAMERA)
    found, _ = refined(pair, truth + np.float32(off_px))
    inner = np.s_[20:-20, 60:-20]
    assert abs(np.median((found - truth)[inner])) < 0.15


def test_one_image_may_be_brighter():
    look = {'contrast': 20.0, 'noise': 2.0}
    found, noise_px = refined(waves.stereo_pair(CAMERA, PLANE, brighter=30.0, **look))
    alike, noise_alike = refined(waves.stereo_pair(CAMERA, PLANE, **look))
    np.testing.assert_allclose(found[INNER], alike[INNER], atol=0.01)
    np.testing.assert_allclose(noise_px[INNER], noise_alike[INNER], atol=0.01)


def test_one_image_may_be_brighter_where_matches_are_missing():
    pair = waves.stereo_pair(CAMERA, PLANE, brighter=30.0, contrast=20.0, noise=2.0)
    missing = np.random.default_rng(5).random(CAMERA.shape) < 0.5
    _, noise_px = refined(pair, np.where(missing, 0, pulled_to_whole_pixels(PLANE)))
    _, without_gaps_px = refined(pair)
    matched = ~missing[INNER]
    assert np.median(noise_px[INNER][matched]) < 1.3 * np.median(without_gaps_px[INNER])


def test_single_match_is_kept_and_noisy():
    pair = waves.stereo_pair(CAMERA, PLANE)
    alone = np.zeros(CAMERA.shape, np.float32)
    alone[90, 120] = whole_pixels()[90, 120]
    found, noise_px = refined(pair, alone)
    assert found[90, 120] == pytest.approx(alone[90, 120], abs=0.1)
    assert noise_px[90, 120] > 0.3


def test_row_shift_is_followed():
    rows = RowAlignment(1.5, 0.01)
    pair = waves.stereo_pair(CAMERA, PLANE, rows)
    pulled = pulled_to_whole_pixels(PLANE)
    assert rms(refined(pair, pulled, rows=rows)[0]) < 0.05
    assert rms(refined(pair, pulled)[0]) > 0.1


def test_camera_offset_is_taken_into_account():
    camera = replace(CAMERA, cx_right=CAMERA.cx - 4.25)
    found, _ = refined(waves.stereo_pair(camera, PLANE), pulled_to_whole_pixels(PLANE), camera)
    assert rms(found) < 0.05


def test_gaps_stay_and_do_not_disturb_their_surroundings():
    pair = waves.stereo_pair(CAMERA, PLANE)
    missing = np.random.default_rng(0).random(CAMERA.shape) < 0.3
    missing[80:110, 100:140] = True
    disparity = np.where(missing, 0, pulled_to_whole_pixels(PLANE))
    found, _ = refined(pair, disparity)
    np.testing.assert_array_equal(found == 0, missing)
    error = (found - PLANE.disparity(CAMERA))[INNER][~missing[INNER]]
    assert np.sqrt(np.mean(error**2)) < 0.05


def test_nothing_matched_stays_so():
    nothing = np.zeros(CAMERA.shape, np.float32)
    found, _ = refined(waves.stereo_pair(CAMERA, PLANE), nothing)
    np.testing.assert_array_equal(found, nothing)


@pytest.mark.parametrize('level', [0, 128])
def test_without_texture_disparity_is_kept_and_noise_is_largest(level):
    image = np.full(CAMERA.shape, level, np.uint8)
    found, noise_px = refined((image, image))
    np.testing.assert_array_equal(found, whole_pixels())
    p = PARAMETERS
    most = p.untextured_noise_px * (1 + p.distant_texture_noise)
    np.testing.assert_allclose(noise_px, np.hypot(most, p.min_noise_px), rtol=1e-4)


def test_noise_grows_with_the_distance_to_texture():
    pair = [image.copy() for image in waves.stereo_pair(CAMERA, PLANE, noise=1.0)]
    generator = np.random.default_rng(3)
    for image in pair:
        shadow = generator.normal(8, 1, (90, 120))
        image[60:150, 80:200] = waves.as_image(shadow)
    _, noise_px = refined(tuple(pair), PLANE.disparity(CAMERA))
    beside, edge, middle = noise_px[30, 140], noise_px[66, 140], noise_px[105, 140]
    assert beside < 0.15 < 0.3 < edge < 0.6 < middle < 1.1


def test_noise_grows_where_texture_fades():
    left, right = waves.stereo_pair(CAMERA, PLANE, noise=2.0)
    fade = np.linspace(1, 0, CAMERA.height)[:, np.newaxis]
    pair = [waves.as_image(128 + fade * (image - 128.0)) for image in (left, right)]
    _, noise_px = refined(pair)
    rows = noise_px[:, 28:-6].mean(axis=1)
    assert rows[:20].max() < 0.15
    assert rows[-4:].min() > 0.35
    assert (np.diff(rows[20::30]) > 0).all()


def test_noise_grows_with_image_noise():
    means = []
    for sigma in (0.0, 2.0, 6.0, 12.0):
        pair = waves.stereo_pair(CAMERA, PLANE, noise=sigma)
        _, noise_px = refined(pair, PLANE.disparity(CAMERA))
        means.append(noise_px[INNER].mean())
    assert means == sorted(means)
    assert means[0] < 0.125 < 0.13 < means[-1] < 0.43


@pytest.mark.parametrize('sigma', [0.0, 2.0, 5.0])
def test_noise_is_about_the_error(sigma):
    found, noise_px = refined(waves.stereo_pair(CAMERA, PLANE, noise=sigma))
    # The lower limit allows for the least noise, that of rough ground: this plane is smooth.
    assert 0.35 < rms(found) / noise_px[INNER].mean() < 1.2


@pytest.mark.parametrize('off_px', [-4.0, -1.0, 1.0, 4.0])
def test_step_is_limited(off_px):
    # Smooth texture: its gradient reaches further than the step may.
    pair = waves.stereo_pair(CAMERA, PLANE, shortest_px=20)
    given = PLANE.disparity(CAMERA) + np.float32(off_px)
    found, _ = refined(pair, given)
    moved = (found - given)[INNER] * -np.sign(off_px)
    assert np.abs(moved).max() <= 1 + 1e-5
    assert np.median(moved) > 0.9
    unlimited, _ = refined(pair, given, parameters=replace(PARAMETERS, max_refinement_px=9.0))
    if abs(off_px) > 1:
        assert np.abs(unlimited - given)[INNER].max() > 2


def test_matched_disparity_stays_positive():
    pair = waves.stereo_pair(CAMERA, DisparityPlane(0, 0, 0.5))
    found, _ = refined(pair, np.full(CAMERA.shape, 0.01, np.float32))
    assert (found > 0).all()


def test_input_is_not_changed():
    given = *waves.stereo_pair(CAMERA, PLANE), whole_pixels()
    before = [array.copy() for array in given]
    refined(given[:2], given[2])
    for array, copy in zip(given, before, strict=True):
        np.testing.assert_array_equal(array, copy)
