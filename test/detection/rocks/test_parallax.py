from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.rocks.outline_features import EVERYWHERE
from rover_obstacle_detection.detection.rocks.parallax import STEP_SHARES, parallax_evidence
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.survey import survey

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
UP = Gravity.from_angles(35.0).up
GROUND = GroundPlane(UP, 1.0, UP)
NOISE = 2.0
MAX_STEP_M = 0.1
TERRAIN = TerrainParameters(max_step_m=MAX_STEP_M)
INNER = np.s_[60:-30, 60:-20]
RAISED = np.s_[100:130, 100:150]


def expected_of(plane):
    disparity = DisparityPlane.from_ground(plane, CAMERA).disparity(CAMERA)
    return np.maximum(disparity, 0).astype(np.float32)


def stereo_of(pair, disparity, noise_px, plane):
    frame = Frame(pair, CAMERA)
    return Stereo(frame, plane, expected_of(plane), disparity, noise_px, NOISE * 2**0.5, 8.0)


def textured_ground():
    """Level ground whose pair shows the same image twice, which fits at no height."""
    expected = expected_of(GROUND)
    image = waves.as_image(waves.texture(*np.meshgrid(np.arange(240), np.arange(180))), NOISE, 1)
    stereo = stereo_of((image, image), expected, np.full_like(expected, 0.1), GROUND)
    return stereo, survey(stereo, TERRAIN)


def evidence_of(
    true_rise_px=0.0,
    matched_rise_px=0.0,
    window=EVERYWHERE,
    contrast=20.0,
    true_steps=0.0,
    unmatched=None,
    plane=GROUND,
    brighter=0.0,
):
    """Evidence for ground with a raised part, which is matched with another disparity.

    The part rises by `true_rise_px` and `true_steps`; heights are measured over `plane`.
    """
    expected = expected_of(GROUND)
    rise = np.zeros_like(expected)
    raised = expected / (1 - true_steps * MAX_STEP_M / GROUND.height_m)
    rise[RAISED] = (raised - expected)[RAISED] + true_rise_px
    columns, rows = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    left = waves.texture(columns - expected - rise, rows, contrast=contrast)
    right = waves.texture(columns, rows, contrast=contrast)
    pair = waves.as_image(left, NOISE, 1), waves.as_image(right + brighter, NOISE, 2)
    disparity = expected.copy()
    disparity[RAISED] += matched_rise_px
    if unmatched:
        disparity[unmatched] = 0
    noise_px = np.full_like(expected, 0.1)
    stereo = stereo_of(pair, disparity, noise_px, plane)
    found = parallax_evidence(stereo, survey(stereo, TERRAIN), MAX_STEP_M, window)
    assert found.dtype == np.float32
    assert np.isfinite(found).all()
    return dict(zip(('matched', *STEP_SHARES), found, strict=True))


def test_rock_fits_better_where_it_was_matched():
    found = evidence_of(true_rise_px=4.0, matched_rise_px=4.0)['matched']
    assert found[RAISED][4:-4, 4:-4].mean() > 5


def test_ground_that_was_matched_too_high_fits_better_on_the_ground():
    found = evidence_of(true_rise_px=0.0, matched_rise_px=4.0)['matched']
    assert found[RAISED][4:-4, 4:-4].mean() < -5


@pytest.mark.parametrize('steps', STEP_SHARES)
@pytest.mark.parametrize('lean_deg', [0.0, 12.0])
def test_rock_matched_on_the_ground_fits_best_at_its_height(steps, lean_deg):
    # Ground rises over a leaning plane, and the camera is less high over it.
    normal = Gravity.from_angles(35.0 - lean_deg).up
    found = evidence_of(true_steps=steps, plane=GroundPlane(normal, 1.3, normal))
    inside = {name: each[RAISED][6:-6, 6:-6].mean() for name, each in found.items()}
    assert abs(inside['matched']) < 1
    assert inside[steps] == max(inside.values())
    assert inside[steps] > 2


@pytest.mark.parametrize('brighter', [-30.0, 30.0])
def test_brightness_may_differ(brighter):
    same, other = (evidence_of(4.0, 4.0, brighter=each) for each in (0.0, brighter))
    for share in STEP_SHARES:
        found, expected = other[share][INNER], same[share][INNER]
        assert np.median(np.abs(found - expected)) < 0.2 * np.median(np.abs(expected))


def test_ground_far_away_is_judged_where_its_disparity_is_less_than_a_pixel():
    plane = GroundPlane(UP, 2.0, UP)
    expected = expected_of(plane)
    columns, rows = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    pair = (
        waves.as_image(waves.texture(columns - expected, rows)),
        waves.as_image(waves.texture(columns, rows)),
    )
    stereo = stereo_of(pair, expected, np.full_like(expected, 0.01), plane)
    far = (expected < 0.9) & (columns > 5)
    assert far.any()
    for each in parallax_evidence(stereo, survey(stereo, TERRAIN), MAX_STEP_M, EVERYWHERE)[1:]:
        assert each[far].astype(bool).mean() > 0.5


@pytest.mark.parametrize('offset_px', [0.0, 9.0, -9.0])
@pytest.mark.parametrize('turn', [0.0, 0.05, -0.05])
def test_right_image_may_be_shifted_and_turned(offset_px, turn):
    camera = replace(CAMERA, cx_right=CAMERA.cx - offset_px)
    rows = RowAlignment(2.0, turn)
    plane = DisparityPlane.from_ground(GROUND, camera)
    frame = Frame(waves.stereo_pair(camera, plane, rows, noise=NOISE), camera)
    disparity = np.maximum(plane.disparity(camera), 0)
    noise_px = np.full_like(disparity, 0.1)
    stereo = Stereo(frame, GROUND, disparity, disparity, noise_px, NOISE * 2**0.5, 8.0, rows=rows)
    found = parallax_evidence(stereo, survey(stereo, TERRAIN), MAX_STEP_M, EVERYWHERE)
    for share, each in zip(STEP_SHARES, found[1:], strict=True):
        assert np.median(each[INNER]) < -share


@pytest.mark.parametrize('share', STEP_SHARES)
def test_level_ground_does_not_fit_above_the_ground(share):
    found = evidence_of()
    assert abs(found['matched'][INNER]).max() < 1
    assert np.median(found[share][INNER]) < -1


def test_heights_are_tried_from_the_ground_and_not_from_the_match():
    found = evidence_of(true_steps=1.0, matched_rise_px=2.6)
    assert found[1.0][RAISED][6:-6, 6:-6].mean() > 2
    assert found[1.0][RAISED][6:-6, 6:-6].mean() > found[2.0][RAISED][6:-6, 6:-6].mean()


def test_nothing_is_known_of_what_is_as_high_as_the_camera():
    found = evidence_of(matched_rise_px=400.0)
    for each in found.values():
        assert np.isfinite(each).all()
        assert not each[RAISED][4:-4, 4:-4].any()


@pytest.mark.parametrize(('height_m', 'known'), [(0.94, True), (0.96, False)])
def test_nothing_is_known_within_a_twentieth_of_the_height_of_the_camera(height_m, known):
    stereo, terrain = textured_ground()
    terrain.camera_m[INNER], terrain.height_m[INNER] = 1.0, height_m
    matched = parallax_evidence(stereo, terrain, MAX_STEP_M, EVERYWHERE)[0]
    assert matched[61:-31, 61:-21].any() == known


def test_evidence_is_relative_to_the_noise_of_the_image_but_at_least_a_grey_level():
    stereo, terrain = textured_ground()
    low, one, four = (
        parallax_evidence(replace(stereo, grey_noise=each), terrain, MAX_STEP_M, EVERYWHERE)
        for each in (0.2, 1.0, 4.0)
    )
    assert one[1:].any()
    np.testing.assert_array_equal(low, one)
    np.testing.assert_allclose(four, one / 16, rtol=1e-5)


@pytest.mark.parametrize('camera_m', [0.0, 1e-6, -1.0])
def test_nothing_is_known_of_ground_as_high_as_the_camera(camera_m):
    stereo, terrain = textured_ground()
    terrain.camera_m[INNER] = camera_m
    terrain.height_m[INNER] = -0.5
    found = parallax_evidence(stereo, terrain, MAX_STEP_M, EVERYWHERE)
    assert np.isfinite(found).all()
    assert not found[:, 61:-31, 61:-21].any()
    assert found[1:, 40:50, 60:-20].any()


def test_nothing_is_known_beyond_the_border_of_the_right_image():
    found = evidence_of()
    ground_px = expected_of(GROUND)
    for share in STEP_SHARES:
        raised_px = ground_px / (1 - share * MAX_STEP_M / GROUND.height_m)
        beyond = np.arange(CAMERA.width) < raised_px - 2
        assert beyond.any()
        assert not found[share][beyond].any()
        assert found[share][100:, 60:].all()
        # Blurred over 3 x 3 pixels, the first pixel within the border shows in the last beyond it.
        left_of_border = raised_px - np.arange(CAMERA.width)
        last = (left_of_border > 0) & (left_of_border < 0.9)
        assert found[share][last].astype(bool).mean() > 0.9


def test_nothing_is_known_without_texture():
    for each in evidence_of(true_rise_px=4.0, matched_rise_px=4.0, contrast=0.0).values():
        assert abs(each[RAISED].mean()) < 0.3


def test_window_has_the_evidence_of_the_whole_image():
    window = np.s_[80:160, 70:200]
    whole = evidence_of(4.0, 4.0)
    part = evidence_of(4.0, 4.0, window)
    inner = np.s_[24:-24, 24:-24]
    for name, each in part.items():
        assert each.shape == (80, 130)
        # Mean brightness is taken within the window, so that it differs a little.
        np.testing.assert_allclose(each[inner], whole[name][window][inner], rtol=0.1, atol=0.5)


def test_nothing_is_known_without_3d():
    gap = np.s_[60:75, 60:90]
    for each in evidence_of(unmatched=gap).values():
        assert not each[gap][1:-1, 1:-1].any()
        assert np.isfinite(each).all()
    assert not any(each.any() for each in evidence_of(unmatched=EVERYWHERE).values())
    assert all(each.size == 0 for each in evidence_of(window=np.s_[0:0, :]).values())
