from __future__ import annotations

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.rocks.outline_features import EVERYWHERE
from rover_obstacle_detection.detection.rocks.parallax import STEP_SHARES, parallax_evidence
from rover_obstacle_detection.detection.stereo.ground_matching import Stereo
from rover_obstacle_detection.detection.terrain.survey import survey

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
UP = Gravity.from_angles(35.0).up
GROUND = GroundPlane(UP, 1.0, UP)
NOISE = 2.0
MAX_STEP_M = 0.1
INNER = np.s_[60:-30, 60:-20]
RAISED = np.s_[100:130, 100:150]


def expected_of(plane):
    disparity = DisparityPlane.from_ground(plane, CAMERA).disparity(CAMERA)
    return np.maximum(disparity, 0).astype(np.float32)


def evidence_of(
    true_rise_px=0.0,
    matched_rise_px=0.0,
    window=EVERYWHERE,
    contrast=20.0,
    true_steps=0.0,
    unmatched=None,
    plane=GROUND,
):
    """Ground, in the middle raised by one disparity, or a height, and matched by another.

    The plane that heights are over need not be that of the ground.
    """
    expected = expected_of(GROUND)
    rise = np.zeros_like(expected)
    raised = expected / (1 - true_steps * MAX_STEP_M / GROUND.height_m)
    rise[RAISED] = (raised - expected)[RAISED] + true_rise_px
    columns, rows = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    left = waves.texture(columns - expected - rise, rows, contrast=contrast)
    right = waves.texture(columns, rows, contrast=contrast)
    pair = waves.as_image(left, NOISE, 1), waves.as_image(right, NOISE, 2)
    disparity = expected.copy()
    disparity[RAISED] += matched_rise_px
    if unmatched:
        disparity[unmatched] = 0
    noise_px = np.full_like(expected, 0.1)
    config = DetectorConfig(max_step=MAX_STEP_M)
    terrain = survey(disparity, noise_px, expected_of(plane), CAMERA, plane, config)
    stereo = Stereo(
        pair, plane, expected_of(plane), disparity, noise_px, RowAlignment(), NOISE * 2**0.5, 8.0
    )
    found = parallax_evidence(stereo, terrain, CAMERA, MAX_STEP_M, window)
    assert found.dtype == np.float32
    assert np.isfinite(found).all()
    return dict(zip(('matched', *STEP_SHARES), found, strict=True))


def test_what_stands_up_fits_better_where_it_was_matched():
    found = evidence_of(true_rise_px=4.0, matched_rise_px=4.0)['matched']
    assert found[RAISED][4:-4, 4:-4].mean() > 5


def test_ground_that_was_matched_too_high_fits_better_on_the_ground():
    found = evidence_of(true_rise_px=0.0, matched_rise_px=4.0)['matched']
    assert found[RAISED][4:-4, 4:-4].mean() < -5


@pytest.mark.parametrize('steps', STEP_SHARES)
@pytest.mark.parametrize('lean_deg', [0.0, 12.0])
def test_what_was_flattened_to_the_ground_fits_best_at_its_height(steps, lean_deg):
    # A plane that leans lets the ground rise to the eye, which is not as high over that plane.
    normal = Gravity.from_angles(35.0 - lean_deg).up
    found = evidence_of(true_steps=steps, plane=GroundPlane(normal, 1.3, normal))
    inside = {name: each[RAISED][6:-6, 6:-6].mean() for name, each in found.items()}
    assert abs(inside['matched']) < 1
    assert inside[steps] == max(inside.values())
    assert inside[steps] > 2


@pytest.mark.parametrize('share', STEP_SHARES)
def test_level_ground_is_not_raised(share):
    found = evidence_of()
    assert abs(found['matched'][INNER]).max() < 1
    assert np.median(found[share][INNER]) < -1


def test_of_a_disparity_that_is_right_heights_count_from_the_ground_below():
    # Matched right, so that the ground it hides is that behind it.
    found = evidence_of(true_steps=1.0, matched_rise_px=2.6)
    assert found[1.0][RAISED][6:-6, 6:-6].mean() > 2
    assert found[1.0][RAISED][6:-6, 6:-6].mean() > found[2.0][RAISED][6:-6, 6:-6].mean()


def test_what_stands_as_high_as_the_eye_hides_no_ground():
    # So near before the eye that it comes up to it.
    found = evidence_of(matched_rise_px=400.0)
    for each in found.values():
        assert np.isfinite(each).all()
        assert not each[RAISED][4:-4, 4:-4].any()


@pytest.mark.parametrize('eye_m', [0.0, 1e-6, -1.0])
def test_ground_in_line_with_the_eye_or_above_it_tells_nothing(eye_m):
    expected = expected_of(GROUND)
    noise_px = np.full_like(expected, 0.1)
    terrain = survey(expected, noise_px, expected, CAMERA, GROUND, DetectorConfig())
    terrain.eye_m[INNER] = eye_m
    terrain.height_m[INNER] = -0.5
    image = waves.as_image(waves.texture(*np.meshgrid(np.arange(240), np.arange(180))), NOISE, 1)
    stereo = Stereo(
        (image, image), GROUND, expected, expected, noise_px, RowAlignment(), NOISE, 8.0
    )
    found = parallax_evidence(stereo, terrain, CAMERA, MAX_STEP_M, EVERYWHERE)
    assert np.isfinite(found).all()
    assert not found[:, 61:-31, 61:-21].any()
    assert found[1:, 40:50, 60:-20].any()


def test_where_the_right_image_ends_nothing_is_told():
    found = evidence_of()
    ground_px = expected_of(GROUND)
    for share in STEP_SHARES:
        raised_px = ground_px / (1 - share * MAX_STEP_M / GROUND.height_m)
        beyond = np.arange(CAMERA.width) < raised_px - 2
        assert beyond.any()
        assert not found[share][beyond].any()
        assert found[share][100:, 60:].all()


def test_without_texture_nothing_is_told():
    for each in evidence_of(true_rise_px=4.0, matched_rise_px=4.0, contrast=0.0).values():
        assert abs(each[RAISED].mean()) < 0.3


def test_window_is_a_part_of_the_whole():
    window = np.s_[80:160, 70:200]
    whole = evidence_of(4.0, 4.0)
    part = evidence_of(4.0, 4.0, window)
    inner = np.s_[24:-24, 24:-24]
    for name, each in part.items():
        assert each.shape == (80, 130)
        # The brightness around is of the window; the gain of much over little hangs on it.
        np.testing.assert_allclose(each[inner], whole[name][window][inner], rtol=0.1, atol=0.5)


def test_without_3d_there_is_nothing_to_compare():
    gap = np.s_[60:75, 60:90]
    for each in evidence_of(unmatched=gap).values():
        assert not each[gap][1:-1, 1:-1].any()
        assert np.isfinite(each).all()
    assert not any(each.any() for each in evidence_of(unmatched=EVERYWHERE).values())
    assert all(each.size == 0 for each in evidence_of(window=np.s_[0:0, :]).values())
