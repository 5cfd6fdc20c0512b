from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.rectification import estimate as row_estimation
from rover_obstacle_detection.detection.rectification.estimate import (
    Rectification,
    estimate_rectification,
)
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
PLANE = DisparityPlane(0.01, 0.05, 12.0)
SLANTED = {'towards_deg': (20.0, 70.0)}


def measured(pair, disparity=None, camera=CAMERA, reduction=1.0):
    if disparity is None:
        disparity = PLANE.disparity(camera)
    return estimate_rectification(pair, disparity, camera, reduction, bent=False).alignment


def found_disparity(alignment):
    """What matching finds: the turn moves columns, too."""
    return waves.disparity_seen(CAMERA, PLANE, alignment)


def check(found, expected):
    assert found.offset_px == pytest.approx(expected.offset_px, abs=0.08)
    assert math.degrees(found.turn) == pytest.approx(math.degrees(expected.turn), abs=0.02)


ALIGNMENTS = [
    RowAlignment(offset, math.radians(turn))
    for offset, turn in ((0, 0), (0.5, 0), (-0.5, 0), (0, 0.3), (-0.5, -0.3), (0.7, 0.2))
]


@pytest.mark.parametrize('off_px', [0.0, 0.25, -0.25])
@pytest.mark.parametrize('look', [{}, SLANTED], ids=['', 'slanted texture'])
@pytest.mark.parametrize('alignment', ALIGNMENTS, ids=str)
def test_shift_and_turn_are_measured_though_disparity_is_off(alignment, look, off_px):
    pair = waves.stereo_pair(CAMERA, PLANE, alignment, noise=2.0, **look)
    check(measured(pair, found_disparity(alignment) + np.float32(off_px)), alignment)


@pytest.mark.parametrize('offset', [-2.0, 1.5, 2.5])
def test_shifts_of_some_pixels_are_measured_too(offset):
    alignment = RowAlignment(offset)
    check(measured(waves.stereo_pair(CAMERA, PLANE, alignment, noise=2.0)), alignment)


def test_right_image_that_shows_things_lower_is_off_by_more_than_nothing():
    left, right = waves.stereo_pair(CAMERA, DisparityPlane(0, 0, 8.0))
    lower = np.vstack((right[:1], right[:-1]))
    found = measured((left, lower), np.full(CAMERA.shape, 8, np.float32))
    check(found, RowAlignment(1.0))


def test_shift_is_told_in_pixels_of_the_full_image():
    alignment = RowAlignment(0.6, 0.003)
    pair = waves.stereo_pair(CAMERA, PLANE, alignment)
    disparity = found_disparity(alignment)
    one, four = measured(pair, disparity), measured(pair, disparity, reduction=4.0)
    assert four.offset_px == pytest.approx(4 * one.offset_px)
    assert four.turn == one.turn
    assert one.offset_px == pytest.approx(0.6, abs=0.08)


def test_turn_is_about_the_principal_point():
    camera = StereoCamera(240, 180, 150.0, 150.0, 80.0, 89.5, 0.1)
    alignment = RowAlignment(0.5, 0.005)
    pair = waves.stereo_pair(camera, PLANE, alignment)
    check(measured(pair, camera=camera), alignment)


def test_disparity_of_infinity_is_taken_into_account():
    camera = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1, cx_right=113.0)
    alignment = RowAlignment(-0.5)
    pair = waves.stereo_pair(camera, PLANE, alignment)
    assert camera.disparity_offset == 6.5
    check(measured(pair, camera=camera), alignment)


def test_brightness_may_differ():
    alignment = RowAlignment(0.5, 0.004)
    pair = waves.stereo_pair(CAMERA, PLANE, alignment, brighter=25.0)
    check(measured(pair), alignment)


@pytest.mark.parametrize('shape', ['half', 'patch'])
def test_pixels_without_a_match_do_not_count(shape):
    alignment = RowAlignment(0.5)
    left, right = waves.stereo_pair(CAMERA, PLANE, alignment)
    disparity = PLANE.disparity(CAMERA)
    spoilt = np.s_[:, :120] if shape == 'half' else np.s_[60:120, 80:160]
    left[spoilt] = np.random.default_rng(0).integers(0, 256, left[spoilt].shape)
    disparity[spoilt] = 0
    found = measured((left, right), disparity)
    assert found.offset_px == pytest.approx(0.5, abs=0.1)


def test_false_matches_are_outvoted():
    alignment = RowAlignment(0.5)
    disparity = PLANE.disparity(CAMERA)
    disparity[60:100, 80:140] += 9
    check(measured(waves.stereo_pair(CAMERA, PLANE, alignment), disparity), alignment)


@pytest.mark.parametrize('level', [0, 128, 255])
def test_without_texture_there_is_none(level):
    image = np.full(CAMERA.shape, level, np.uint8)
    assert measured((image, image)) == STRAIGHT


def test_texture_that_does_not_change_down_the_image_tells_nothing():
    columns = np.broadcast_to(np.arange(CAMERA.width), CAMERA.shape)
    left = waves.as_image(waves.texture(columns, 0 * columns))
    right = np.roll(left, -8, axis=1)
    found = measured((left, right), np.full(CAMERA.shape, 8, np.float32))
    assert abs(found.offset_px) < 0.01
    assert abs(found.turn) < 1e-4


@pytest.mark.parametrize(('matched', 'enough'), [(0, False), (499, False), (2000, True)])
def test_too_little_matched_is_none(matched, enough):
    alignment = RowAlignment(0.5)
    pair = waves.stereo_pair(CAMERA, PLANE, alignment)
    disparity = np.zeros(CAMERA.shape, np.float32)
    rows = np.s_[80 : 80 + 20, 60:160]
    some = np.zeros(2000, np.float32)
    some[:matched] = 1
    disparity[rows] = some.reshape(20, 100) * PLANE.disparity(CAMERA)[rows]
    found = measured(pair, disparity)
    if enough:
        assert found.offset_px == pytest.approx(0.5, abs=0.2)
    else:
        assert found == STRAIGHT


@pytest.mark.parametrize(
    ('offset', 'kept'), [(0.7, True), (-0.7, True), (0.8, False), (-0.8, False)]
)
def test_shift_of_more_than_three_pixels_is_no_shift(offset, kept):
    pair = waves.stereo_pair(CAMERA, PLANE, RowAlignment(offset), shortest_px=8)
    found = measured(pair, reduction=4.0)
    if kept:
        assert found.offset_px == pytest.approx(4 * offset, abs=0.2)
    else:
        assert found == STRAIGHT


def test_images_stay_as_they_are():
    left, right = waves.stereo_pair(CAMERA, PLANE)
    disparity = PLANE.disparity(CAMERA)
    before = left.copy(), right.copy(), disparity.copy()
    measured((left, right), disparity)
    for array, copy in zip((left, right, disparity), before, strict=True):
        np.testing.assert_array_equal(array, copy)


BENT = LensDistortion(0.025, -0.008, 0.0)
LENSES = [
    (STRAIGHT, Lenses(BENT)),
    (STRAIGHT, Lenses(right=BENT)),
    (STRAIGHT, Lenses(BENT, LensDistortion(0.01))),
    (RowAlignment(0.4, 0.003), Lenses(LensDistortion(-0.01), BENT)),
]
INNER = np.s_[10:-10, 30:-10]


def bent_pair(alignment, lenses):
    return waves.stereo_pair(CAMERA, PLANE, alignment, lenses=lenses, noise=2.0)


def estimate(alignment, lenses, reduction=1.0):
    disparity = waves.disparity_seen(CAMERA, PLANE, alignment, lenses)
    pair = bent_pair(alignment, lenses)
    return estimate_rectification(pair, disparity, CAMERA, reduction)


def moved_columns(alignment, lenses):
    """By how much both lenses and the turn change the disparity of the plane."""
    return waves.disparity_seen(CAMERA, PLANE, alignment, lenses) - PLANE.disparity(CAMERA)


def error_px(found, alignment, lenses):
    error = moved_columns(found.alignment, found.lenses) - moved_columns(alignment, lenses)
    return np.sqrt(np.mean(error[INNER] ** 2))


@pytest.mark.parametrize(('alignment', 'lenses'), LENSES, ids=str)
def test_lenses_that_bend_rows_tell_how_they_bend_columns(alignment, lenses):
    found = estimate(alignment, lenses)
    assert found.gain > 100
    assert np.abs(moved_columns(alignment, lenses)[INNER]).max() > 0.8
    assert error_px(found, alignment, lenses) < 0.15
    assert found.alignment.offset_px == pytest.approx(alignment.offset_px, abs=0.08)
    assert found.moved_px > 0.1


@pytest.mark.parametrize('alignment', [STRAIGHT, RowAlignment(0.7, 0.004)], ids=str)
def test_straight_lenses_explain_hardly_more_than_chance_would(alignment):
    assert estimate(alignment, STRAIGHT_LENSES).gain < 20


@pytest.mark.parametrize(('alignment', 'lenses'), LENSES, ids=str)
def test_what_is_known_of_the_lenses_is_built_upon(alignment, lenses):
    first = estimate(alignment, lenses)
    straight = first.lenses.straightened(bent_pair(alignment, lenses), CAMERA)
    second = estimate_rectification(
        straight, PLANE.disparity(CAMERA), CAMERA, 1.0, first.alignment, first.lenses
    )
    assert second.gain > 100
    assert second.moved_px < 0.5
    assert error_px(second, alignment, lenses) < 0.12


def test_lenses_are_told_whatever_the_reduction():
    one, four = (estimate(*LENSES[3], reduction) for reduction in (1.0, 4.0))
    assert four.lenses == one.lenses
    assert four.alignment.offset_px == pytest.approx(4 * one.alignment.offset_px)
    assert four.moved_px == pytest.approx(4 * one.moved_px)
    assert four.gain == one.gain


@pytest.mark.parametrize('level', [0, 128, 255])
def test_without_texture_there_are_no_lenses(level):
    image = np.full(CAMERA.shape, level, np.uint8)
    found = estimate_rectification((image, image), PLANE.disparity(CAMERA), CAMERA, 1.0)
    assert found.gain == 0


def test_too_little_matched_tells_no_lenses():
    disparity = np.zeros(CAMERA.shape, np.float32)
    disparity[:, 100:102] = 12
    known = RowAlignment(0.5), Lenses(BENT)
    found = estimate_rectification(bent_pair(*LENSES[0]), disparity, CAMERA, 1.0, *known)
    assert found == Rectification(*known, 0.0, 0.0)


def test_what_bends_too_far_is_no_rest_of_a_rectification(monkeypatch):
    bends = estimate(*LENSES[0]).lenses.most_bend_px(CAMERA)
    for factor, believed in ((0.9, False), (1.1, True)):
        monkeypatch.setattr(row_estimation, '_MOST_BENT', bends / factor / CAMERA.width)
        found = estimate(*LENSES[0])
        assert (found.gain > 0) != believed
        assert (found.lenses == STRAIGHT_LENSES) == believed


@pytest.mark.parametrize('cx_right', [100.0, 130.0])
@pytest.mark.parametrize('side', ['left', 'right'])
def test_lenses_of_eyes_with_principal_points_and_focal_lengths_of_their_own(side, cx_right):
    camera = StereoCamera(240, 180, 150.0, 140.0, 119.5, 80.0, 0.1, cx_right=cx_right)
    lenses = Lenses(**{side: LensDistortion(0.03)})
    pair = waves.stereo_pair(camera, PLANE, lenses=lenses, noise=2.0)
    disparity = waves.disparity_seen(camera, PLANE, lenses=lenses)
    found = estimate_rectification(pair, disparity, camera, 1.0)
    assert found.gain > 100
    error = waves.disparity_seen(camera, PLANE, lenses=found.lenses) - disparity
    bent = disparity - PLANE.disparity(camera)
    assert np.abs(bent[INNER]).max() > 0.8
    assert np.sqrt(np.mean(error[INNER] ** 2)) < 0.2


@pytest.mark.parametrize('turns_deg', [(0.3, 0.0), (0.0, 0.3), (-0.3, 0.3)], ids=str)
def test_an_eye_that_looks_aside_or_up_is_no_lens(turns_deg):
    aside, up = np.tan(np.radians(turns_deg))
    left, right = waves.stereo_pair(CAMERA, PLANE, noise=2.0)
    columns, rows = np.meshgrid(np.arange(240.0), np.arange(180.0))
    x, y = (columns - CAMERA.cx) / CAMERA.fx, (rows - CAMERA.cy) / CAMERA.fy
    # What a small turn moves, less its shift of all.
    places = (
        columns + (aside * x * x + up * x * y) * CAMERA.fx,
        rows + (aside * x * y + up * y * y) * CAMERA.fy,
    )
    turned = cv2.remap(
        right, *(each.astype(np.float32) for each in places), cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    reached = columns - PLANE.disparity(CAMERA)
    at = (reached - CAMERA.cx) / CAMERA.fx
    disparity = PLANE.disparity(CAMERA) + (aside * at * at + up * at * y) * CAMERA.fx
    found = estimate_rectification((left, turned), disparity.astype(np.float32), CAMERA, 1.0)
    assert found.gain < 25
