from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.rectification.correction import UNCORRECTED, Correction
from rover_obstacle_detection.detection.rectification.estimate import (
    RectificationEstimate,
    estimate_rectification,
)
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.rectification.reduced_pair import ReducedPair
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment

CAMERA = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1)
PLANE = DisparityPlane(0.01, 0.05, 12.0)
PARAMETERS = RectificationParameters()
SLANTED = {'towards_deg': (20.0, 70.0)}


def measured(pair, disparity=None, camera=CAMERA, reduction=1.0):
    if disparity is None:
        disparity = PLANE.disparity(camera)
    reduced = ReducedPair(pair, camera, reduction)
    return estimate_rectification(reduced, disparity, UNCORRECTED).correction.rows


def found_disparity(alignment):
    """Disparity as matching finds it: a turn moves columns too."""
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
def test_offset_and_turn_are_measured_despite_disparity_errors(alignment, look, off_px):
    pair = waves.stereo_pair(CAMERA, PLANE, alignment, noise=2.0, **look)
    check(measured(pair, found_disparity(alignment) + np.float32(off_px)), alignment)


@pytest.mark.parametrize('offset', [-2.0, 1.5, 2.5])
def test_offsets_of_a_few_pixels_are_measured(offset):
    alignment = RowAlignment(offset)
    check(measured(waves.stereo_pair(CAMERA, PLANE, alignment, noise=2.0)), alignment)


def test_offset_is_positive_if_the_right_image_shows_things_lower():
    left, right = waves.stereo_pair(CAMERA, DisparityPlane(0, 0, 8.0))
    lower = np.vstack((right[:1], right[:-1]))
    found = measured((left, lower), np.full(CAMERA.shape, 8, np.float32))
    check(found, RowAlignment(1.0))


def test_offset_is_in_pixels_of_the_full_image():
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


def test_principal_points_may_differ():
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
def test_unmatched_pixels_do_not_count(shape):
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
def test_an_image_without_texture_has_no_row_shift(level):
    image = np.full(CAMERA.shape, level, np.uint8)
    assert measured((image, image)) == STRAIGHT


def test_vertical_stripes_show_no_row_shift():
    columns = np.broadcast_to(np.arange(CAMERA.width), CAMERA.shape)
    left = waves.as_image(waves.texture(columns, 0 * columns))
    right = np.roll(left, -8, axis=1)
    found = measured((left, right), np.full(CAMERA.shape, 8, np.float32))
    assert abs(found.offset_px) < 0.01
    assert abs(found.turn) < 1e-4


@pytest.mark.parametrize(('matched', 'enough'), [(0, False), (499, False), (2000, True)])
def test_few_matches_give_no_estimate(matched, enough):
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
def test_shifts_beyond_the_largest_are_rejected(offset, kept):
    pair = waves.stereo_pair(CAMERA, PLANE, RowAlignment(offset), shortest_px=8)
    found = measured(pair, reduction=4.0)
    if kept:
        assert found.offset_px == pytest.approx(4 * offset, abs=0.2)
    else:
        assert found == STRAIGHT


def test_turns_count_by_their_shift_at_the_sides_of_the_image():
    turned = RowAlignment(0.0, 0.006)
    reduced = ReducedPair(waves.stereo_pair(CAMERA, PLANE, turned), CAMERA, 1.0)
    side_px = 0.006 * CAMERA.width / 2
    for limit_px, kept in ((0.9 * side_px, False), (1.1 * side_px, True)):
        known = Correction(parameters=replace(PARAMETERS, max_row_shift_px=limit_px))
        found = estimate_rectification(reduced, found_disparity(turned), known)
        assert (found.correction.rows != STRAIGHT) == kept


def test_inputs_are_not_changed():
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


def estimate(alignment, lenses, reduction=1.0, parameters=PARAMETERS):
    disparity = waves.disparity_seen(CAMERA, PLANE, alignment, lenses)
    reduced = ReducedPair(bent_pair(alignment, lenses), CAMERA, reduction)
    return estimate_rectification(reduced, disparity, Correction(parameters=parameters))


def moved_columns(alignment, lenses):
    """Disparity that both lenses and the turn add to the plane."""
    return waves.disparity_seen(CAMERA, PLANE, alignment, lenses) - PLANE.disparity(CAMERA)


def error_px(found, alignment, lenses):
    measured = moved_columns(found.correction.rows, found.correction.lenses)
    return np.sqrt(np.mean((measured - moved_columns(alignment, lenses))[INNER] ** 2))


@pytest.mark.parametrize(('alignment', 'lenses'), LENSES, ids=str)
def test_distortion_of_columns_follows_from_that_of_rows(alignment, lenses):
    found = estimate(alignment, lenses)
    assert found.lens_gain > 100
    assert np.abs(moved_columns(alignment, lenses)[INNER]).max() > 0.8
    assert error_px(found, alignment, lenses) < 0.15
    assert found.correction.rows.offset_px == pytest.approx(alignment.offset_px, abs=0.08)
    assert found.lens_change_px > 0.1


@pytest.mark.parametrize('alignment', [STRAIGHT, RowAlignment(0.7, 0.004)], ids=str)
def test_straight_lenses_have_a_low_gain(alignment):
    assert estimate(alignment, STRAIGHT_LENSES).lens_gain < 20


@pytest.mark.parametrize(('alignment', 'lenses'), LENSES, ids=str)
def test_estimate_refines_known_lenses(alignment, lenses):
    first = estimate(alignment, lenses)
    straight = first.correction.lenses.straightened(bent_pair(alignment, lenses), CAMERA)
    second = estimate_rectification(
        ReducedPair(straight, CAMERA, 1.0), PLANE.disparity(CAMERA), first.correction
    )
    assert second.lens_gain > 100
    assert second.lens_change_px < 0.5
    assert error_px(second, alignment, lenses) < 0.12


def test_lenses_do_not_depend_on_the_reduction():
    one, four = (estimate(*LENSES[3], reduction) for reduction in (1.0, 4.0))
    assert four.correction.lenses == one.correction.lenses
    one_px, four_px = (each.correction.rows.offset_px for each in (one, four))
    assert four_px == pytest.approx(4 * one_px)
    assert four.lens_change_px == pytest.approx(4 * one.lens_change_px)
    assert four.lens_gain == one.lens_gain


@pytest.mark.parametrize('level', [0, 128, 255])
def test_an_image_without_texture_has_no_lens_gain(level):
    image = np.full(CAMERA.shape, level, np.uint8)
    reduced = ReducedPair((image, image), CAMERA, 1.0)
    found = estimate_rectification(reduced, PLANE.disparity(CAMERA), UNCORRECTED)
    assert found.lens_gain == 0


def test_few_matches_leave_what_is_known():
    disparity = np.zeros(CAMERA.shape, np.float32)
    disparity[:, 100:102] = 12
    known = Correction(RowAlignment(0.5), Lenses(BENT))
    reduced = ReducedPair(bent_pair(*LENSES[0]), CAMERA, 1.0)
    found = estimate_rectification(reduced, disparity, known)
    assert found == RectificationEstimate(known)
    assert found.lens_gain == found.lens_change_px == 0


def test_distortion_beyond_the_largest_is_rejected():
    bend_px = estimate(*LENSES[0]).correction.lenses.max_bend_px(CAMERA)
    for factor, accepted in ((0.9, False), (1.1, True)):
        limit = replace(PARAMETERS, max_bend_share=factor * bend_px / CAMERA.width)
        found = estimate(*LENSES[0], parameters=limit)
        assert (found.lens_gain > 0) == accepted
        assert bool(found.correction.lenses) == accepted


@pytest.mark.parametrize('cx_right', [100.0, 130.0])
@pytest.mark.parametrize('side', ['left', 'right'])
def test_cameras_with_unequal_principal_points_and_focal_lengths(side, cx_right):
    camera = StereoCamera(240, 180, 150.0, 140.0, 119.5, 80.0, 0.1, cx_right=cx_right)
    lenses = Lenses(**{side: LensDistortion(0.03)})
    pair = waves.stereo_pair(camera, PLANE, lenses=lenses, noise=2.0)
    disparity = waves.disparity_seen(camera, PLANE, lenses=lenses)
    reduced = ReducedPair(pair, camera, 1.0)
    found = estimate_rectification(reduced, disparity, UNCORRECTED)
    assert found.lens_gain > 100
    error = waves.disparity_seen(camera, PLANE, lenses=found.correction.lenses) - disparity
    bent = disparity - PLANE.disparity(camera)
    assert np.abs(bent[INNER]).max() > 0.8
    assert np.sqrt(np.mean(error[INNER] ** 2)) < 0.2


@pytest.mark.parametrize('turns_deg', [(0.3, 0.0), (0.0, 0.8), (-0.3, 0.3)], ids=str)
def test_a_right_camera_that_looks_aside_or_up_is_not_taken_for_distortion(turns_deg):
    aside, up = np.tan(np.radians(turns_deg))
    left, right = waves.stereo_pair(CAMERA, PLANE, noise=2.0)
    columns, rows = np.meshgrid(np.arange(240.0), np.arange(180.0))
    x, y = (columns - CAMERA.cx) / CAMERA.fx, (rows - CAMERA.cy) / CAMERA.fy
    # A small rotation, without the shift of the whole image.
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
    reduced = ReducedPair((left, turned), CAMERA, 1.0)
    found = estimate_rectification(reduced, disparity.astype(np.float32), UNCORRECTED)
    assert found.lens_gain < 20
