from __future__ import annotations

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.stereo.subpixel import refine_disparity

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
# So slanted that windows lie within a pixel of disparity, and so that they do not.
PLANE = DisparityPlane(0.004, 0.01, 12.0)
STEEP = DisparityPlane(0.012, 0.057, 12.0)
STRAIGHT = RowAlignment()
# Where the right image shows what the left one does.
INNER = np.s_[6:-6, 28:-6]


def whole_pixels(plane=PLANE):
    return np.rint(plane.disparity(CAMERA))


def refined(pair, disparity=None, camera=CAMERA, alignment=STRAIGHT):
    disparity = whole_pixels() if disparity is None else disparity
    refined = refine_disparity(*pair, disparity, camera, alignment)
    found, noise_px = refined.disparity, refined.noise_px
    for array in (found, noise_px):
        assert array.dtype == np.float32
        assert array.shape == disparity.shape
        assert np.isfinite(array).all()
    return found, noise_px


def rms(found, plane=PLANE):
    return np.sqrt(np.mean((found - plane.disparity(CAMERA))[INNER] ** 2))


def drawn_to_whole_pixels(plane):
    """As semi-global matching draws it: most of all a quarter from a whole pixel."""
    truth = plane.disparity(CAMERA)
    return (truth - 0.12 * np.sin(2 * np.pi * truth)).astype(np.float32)


@pytest.mark.parametrize(('noise', 'limit'), [(0.0, 0.12), (2.0, 0.13), (5.0, 0.18)])
def test_whole_pixels_are_brought_to_fractions(noise, limit):
    pair = waves.stereo_pair(CAMERA, PLANE, noise=noise)
    assert rms(whole_pixels()) == pytest.approx(12**-0.5, abs=0.03)
    assert rms(refined(pair)[0]) < limit


@pytest.mark.parametrize('noise', [2.0, 5.0])
def test_grey_noise_is_that_between_both_images(noise):
    disparity = PLANE.disparity(CAMERA).astype(np.float32)
    found = refine_disparity(
        *waves.stereo_pair(CAMERA, PLANE, noise=noise), disparity, CAMERA, STRAIGHT
    )
    assert found.grey_noise == pytest.approx(noise * 2**0.5, rel=0.15)


@pytest.mark.parametrize(('noise', 'limit'), [(0.0, 0.05), (2.0, 0.06)])
@pytest.mark.parametrize('plane', [PLANE, STEEP], ids=['', 'steep'])
def test_pull_to_whole_pixels_is_taken_out(plane, noise, limit):
    drawn = drawn_to_whole_pixels(plane)
    assert rms(drawn, plane) == pytest.approx(0.085, abs=0.005)
    found, _ = refined(waves.stereo_pair(CAMERA, plane, noise=noise), drawn)
    assert rms(found, plane) < limit


@pytest.mark.parametrize('slope', [0.15, -0.15])
def test_plane_that_tilts_sideways(slope):
    plane = DisparityPlane(slope, 0.02, 22.0)
    truth = plane.disparity(CAMERA)
    found, _ = refined(waves.stereo_pair(CAMERA, plane), truth + np.float32(0.2))
    inner = np.s_[6:-6, 46:-6]
    assert np.sqrt(np.mean((found - truth)[inner] ** 2)) < 0.07


def test_true_disparity_stays():
    truth = PLANE.disparity(CAMERA)
    found, _ = refined(waves.stereo_pair(CAMERA, PLANE), truth)
    assert rms(found) < 0.04
    np.testing.assert_allclose(found[INNER], truth[INNER], atol=0.1)


@pytest.mark.parametrize('off_px', [-0.5, 0.5])
def test_what_little_texture_let_sag_is_put_right(off_px):
    pair = waves.stereo_pair(CAMERA, PLANE, contrast=3.0, noise=2.0)
    truth = PLANE.disparity(CAMERA)
    found, _ = refined(pair, truth + np.float32(off_px))
    inner = np.s_[20:-20, 60:-20]
    assert abs(np.median((found - truth)[inner])) < 0.15


def test_one_eye_may_be_brighter():
    look = {'contrast': 20.0, 'noise': 2.0}
    found, noise_px = refined(waves.stereo_pair(CAMERA, PLANE, brighter=30.0, **look))
    alike, noise_alike = refined(waves.stereo_pair(CAMERA, PLANE, **look))
    np.testing.assert_allclose(found[INNER], alike[INNER], atol=0.01)
    np.testing.assert_allclose(noise_px[INNER], noise_alike[INNER], atol=0.01)


def test_one_eye_may_be_brighter_where_matches_are_missing_too():
    left, right = waves.stereo_pair(CAMERA, PLANE, brighter=30.0, contrast=20.0, noise=2.0)
    missing = np.random.default_rng(5).random(CAMERA.shape) < 0.5
    drawn = np.where(missing, 0, drawn_to_whole_pixels(PLANE))
    _, noise_px = refined((left, right), drawn)
    _, whole_px = refined((left, right))
    assert np.median(noise_px[INNER][~missing[INNER]]) < 1.3 * np.median(whole_px[INNER])


def test_a_single_match_stays_where_it_is():
    pair = waves.stereo_pair(CAMERA, PLANE)
    alone = np.zeros(CAMERA.shape, np.float32)
    alone[90, 120] = whole_pixels()[90, 120]
    found, noise_px = refined(pair, alone)
    assert found[90, 120] == pytest.approx(alone[90, 120], abs=0.1)
    assert noise_px[90, 120] > 0.3


def test_rows_that_are_off_are_read_where_they_are():
    alignment = RowAlignment(1.5, 0.01)
    pair = waves.stereo_pair(CAMERA, PLANE, alignment)
    drawn = drawn_to_whole_pixels(PLANE)
    assert rms(refined(pair, drawn, alignment=alignment)[0]) < 0.05
    assert rms(refined(pair, drawn)[0]) > 0.1


def test_disparity_of_infinity_is_taken_into_account():
    camera = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1, cx_right=115.25)
    found, _ = refined(waves.stereo_pair(camera, PLANE), drawn_to_whole_pixels(PLANE), camera)
    assert rms(found) < 0.05


def test_no_match_stays_none_and_spoils_nothing_around():
    pair = waves.stereo_pair(CAMERA, PLANE)
    missing = np.random.default_rng(0).random(CAMERA.shape) < 0.3
    missing[80:110, 100:140] = True
    disparity = np.where(missing, 0, drawn_to_whole_pixels(PLANE))
    found, _ = refined(pair, disparity)
    np.testing.assert_array_equal(found == 0, missing)
    error = (found - PLANE.disparity(CAMERA))[INNER][~missing[INNER]]
    assert np.sqrt(np.mean(error**2)) < 0.05


def test_nothing_matched_at_all():
    nothing = np.zeros(CAMERA.shape, np.float32)
    found, _ = refined(waves.stereo_pair(CAMERA, PLANE), nothing)
    np.testing.assert_array_equal(found, nothing)


@pytest.mark.parametrize('level', [0, 128])
def test_without_texture_disparity_stays_and_may_be_a_pixel_off(level):
    image = np.full(CAMERA.shape, level, np.uint8)
    found, noise_px = refined((image, image))
    np.testing.assert_array_equal(found, whole_pixels())
    np.testing.assert_allclose(noise_px, np.hypot(0.35 * 2.5, 0.12), rtol=1e-4)


def test_the_farther_texture_the_noisier():
    pair = [eye.copy() for eye in waves.stereo_pair(CAMERA, PLANE, noise=1.0)]
    generator = np.random.default_rng(3)
    for eye in pair:
        shadow = generator.normal(8, 1, (90, 120))
        eye[60:150, 80:200] = waves.as_image(shadow)
    _, noise_px = refined(tuple(pair), PLANE.disparity(CAMERA))
    beside, edge, middle = noise_px[30, 140], noise_px[66, 140], noise_px[105, 140]
    assert beside < 0.15 < 0.3 < edge < 0.6 < middle < 1.1


def test_where_texture_fades_out_noise_grows():
    left, right = waves.stereo_pair(CAMERA, PLANE, noise=2.0)
    fade = np.linspace(1, 0, CAMERA.height)[:, np.newaxis]
    pair = [waves.as_image(128 + fade * (eye - 128.0)) for eye in (left, right)]
    _, noise_px = refined(pair)
    rows = noise_px[:, 28:-6].mean(axis=1)
    assert rows[:20].max() < 0.15
    assert rows[-4:].min() > 0.35
    assert (np.diff(rows[20::30]) > 0).all()


def test_noise_grows_with_that_of_the_images():
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
    # The floor is that of rough ground, which these waves have not.
    assert 0.35 < rms(found) / noise_px[INNER].mean() < 1.2


@pytest.mark.parametrize('off_px', [-4.0, -1.0, 1.0, 4.0])
def test_step_is_limited(off_px):
    pair = waves.stereo_pair(CAMERA, PLANE)
    given = PLANE.disparity(CAMERA) + np.float32(off_px)
    found, _ = refined(pair, given)
    assert np.abs(found - given).max() <= 1 + 1e-5
    if abs(off_px) == 1:
        assert np.median(np.abs(found - PLANE.disparity(CAMERA))[INNER]) < 0.8


def test_disparity_stays_over_nothing():
    pair = waves.stereo_pair(CAMERA, DisparityPlane(0, 0, 0.5))
    found, _ = refined(pair, np.full(CAMERA.shape, 0.01, np.float32))
    assert (found > 0).all()


def test_images_and_disparity_stay_as_they_are():
    left, right = waves.stereo_pair(CAMERA, PLANE)
    disparity = whole_pixels()
    before = left.copy(), right.copy(), disparity.copy()
    refined((left, right), disparity)
    for array, copy in zip((left, right, disparity), before, strict=True):
        np.testing.assert_array_equal(array, copy)
