from __future__ import annotations

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    NO_DISTORTION,
    STRAIGHT_LENSES,
    LensDistortion,
    Lenses,
)

CAMERA = StereoCamera(240, 180, 150.0, 140.0, 125.0, 80.0, 0.1, cx_right=110.0)


def test_stretch_is_browns_polynomial():
    lens = LensDistortion(0.1, -0.02, 0.003)
    x, y = np.array([[0.0, 0.6, 3.0]], np.float32), np.array([[0.0], [0.8], [4.0]], np.float32)
    found = lens.stretch(x, y)
    assert found.dtype == np.float32
    assert found.shape == (3, 3)
    assert found[0, 0] == 0
    assert found[1, 1] == pytest.approx(0.1 - 0.02 + 0.003)
    assert found[2, 2] == pytest.approx(0.1 * 25 - 0.02 * 25**2 + 0.003 * 25**3)


def test_distortion_is_true_if_there_is_any():
    assert not NO_DISTORTION
    assert not LensDistortion(0.0, 0.0, 0.0)
    assert LensDistortion(0.0, 1e-6, 0.0)


INNER = np.s_[12:-12, 16:-16]


def places():
    return np.meshgrid(
        np.arange(CAMERA.width, dtype=np.float32), np.arange(CAMERA.height, dtype=np.float32)
    )


@pytest.mark.parametrize('eye', ['left', 'right'])
@pytest.mark.parametrize('coefficients', [(0.1, 0, 0), (0, 0.1, 0), (0.1, 0.05, -0.05)])
def test_straightened_image_shows_things_where_a_straight_lens_would(eye, coefficients):
    lens = LensDistortion(*coefficients)
    where = waves.straight_left if eye == 'left' else waves.straight_right
    straight = waves.as_image(waves.texture(*places()))
    bent = waves.as_image(waves.texture(*where(CAMERA, *places(), lens)))
    other = np.zeros_like(bent)
    pair = (bent, other) if eye == 'left' else (other, bent)
    found = Lenses(**{eye: lens}).straightened(pair, CAMERA)

    def error(image):
        return np.median(np.abs(image.astype(float) - straight)[INNER])

    assert error(bent) > 2
    assert error(found[pair[0] is other]) < 1
    assert found[pair[0] is bent] is other


def test_straight_lenses_cost_nothing():
    pair = np.zeros(CAMERA.shape, np.uint8), np.ones(CAMERA.shape, np.uint8)
    found = STRAIGHT_LENSES.straightened(pair, CAMERA)
    assert found[0] is pair[0]
    assert found[1] is pair[1]
    assert not STRAIGHT_LENSES
    assert Lenses(right=LensDistortion(0.1))
    assert Lenses(LensDistortion(0.1))


def test_places_in_the_left_image_and_in_its_straightened_self():
    lenses = Lenses(LensDistortion(0.05, -0.01, 0.0), LensDistortion(1.0))
    columns, rows = lenses.left_places(CAMERA)
    # Column 200 of row 150 is half a focal length to the right and half one down.
    assert columns[150, 200] == pytest.approx(125 + 75 * (1 + 0.05 * 0.5 - 0.01 * 0.25))
    assert rows[150, 200] == pytest.approx(80 + 70 * (1 + 0.05 * 0.5 - 0.01 * 0.25))
    straight = lenses.straight_left_places(CAMERA)
    assert all(each.dtype == np.float32 for each in (columns, rows, *straight))
    expected = waves.straight_left(CAMERA, *places(), lenses.left)
    np.testing.assert_allclose(straight, expected, atol=0.02)


def test_places_that_a_lens_shows_nowhere_are_not_a_number():
    # Nothing is seen farther out than at a radius of 0.384 focal lengths.
    columns, rows = Lenses(LensDistortion(-1.0)).straight_left_places(CAMERA)
    x, y = CAMERA.rays()
    radius = np.hypot(x, y)
    assert np.isfinite(columns[radius < 0.35]).all()
    assert np.isnan(columns[radius > 0.4]).mean() > 0.9
    np.testing.assert_array_equal(np.isnan(columns), np.isnan(rows))


def test_mask_is_straightened_as_the_left_image_is():
    lenses = Lenses(LensDistortion(0.1))
    columns, rows = waves.straight_left(CAMERA, *places(), lenses.left)
    inside = np.hypot(columns - 60, rows - 60) < 30
    found = lenses.straightened_mask(inside, CAMERA)
    assert found.dtype == np.bool_
    straight = np.hypot(places()[0] - 60, places()[1] - 60) < 30
    assert (found & straight).sum() / (found | straight).sum() > 0.97
    assert (inside & straight).sum() / (inside | straight).sum() < 0.93
    assert Lenses(right=LensDistortion(0.1)).straightened_mask(inside, CAMERA) is inside
    assert lenses.straightened_mask(None, CAMERA) is None


def test_how_far_a_lens_moves_pixels_on_average_and_at_most():
    camera = StereoCamera(401, 16, 200.0, 200.0, 200.0, 7.5, 0.1)
    assert STRAIGHT_LENSES.mean_bend_px(camera) == 0
    # Over a radius of up to one focal length r^3 is a quarter on average.
    lenses = Lenses(LensDistortion(-0.004), LensDistortion(0.01))
    assert lenses.mean_bend_px(camera) == pytest.approx(0.01 * 200 / 4, rel=0.1)
    assert lenses.most_bend_px(camera) == pytest.approx(0.01 * 200, rel=0.01)


def test_each_lens_bends_about_its_own_principal_point():
    camera = StereoCamera(401, 16, 200.0, 200.0, 200.0, 7.5, 0.1, cx_right=100.0)
    assert Lenses(LensDistortion(0.01)).most_bend_px(camera) == pytest.approx(2, rel=0.01)
    right = Lenses(right=LensDistortion(0.01))
    assert right.most_bend_px(camera) == pytest.approx(2 * 1.5**3, rel=0.01)


def test_a_lens_that_bends_most_in_between_is_told_so():
    camera = StereoCamera(401, 16, 200.0, 200.0, 200.0, 7.5, 0.1)
    # r^3 - r^5 is largest at a radius of sqrt(3 / 5).
    lenses = Lenses(LensDistortion(0.01, -0.01))
    assert lenses.most_bend_px(camera) == pytest.approx(2 * 0.6**1.5 * 0.4, rel=0.01)


def test_how_far_lenses_were_moved():
    camera = StereoCamera(401, 16, 200.0, 200.0, 200.0, 7.5, 0.1)
    before = Lenses(LensDistortion(0.02), LensDistortion(0.01))
    now = Lenses(LensDistortion(0.016), LensDistortion(0.02))
    assert now.moved_px(camera, now) == 0
    assert now.moved_px(camera, before) == pytest.approx(0.01 * 200 / 4, rel=0.1)


def test_what_no_eye_saw_is_matched_with_nothing():
    camera = StereoCamera(240, 180, 150.0, 150.0, 119.5, 89.5, 0.1, cx_right=109.5)
    disparity = np.full(camera.shape, 20, np.float32)
    disparity[:, 100] = 0
    assert not STRAIGHT_LENSES.unseen(disparity, camera).any()
    # Seen too near the axis: a straightened image is full.
    full = Lenses(LensDistortion(-0.1), LensDistortion(-0.1))
    assert not full.unseen(disparity, camera)[6:-6, 40:-6].any()
    # Seen too far out, the corners belong outside the frame.
    for lenses in (Lenses(LensDistortion(0.1)), Lenses(right=LensDistortion(0.1))):
        unseen = lenses.unseen(disparity, camera)
        assert unseen[:, 234:].any() or unseen[:, :40].any()
        assert not unseen[60:120, 60:180].any()
        assert not unseen[disparity == 0].any()
    left = Lenses(LensDistortion(0.1)).unseen(disparity, camera)
    # Row 5 of the middle column is seen at 84.5 (1 + 0.1 (84.5 / 150)^2) px from the axis.
    assert left[3, 120]
    assert not left[12, 120]
    right = Lenses(right=LensDistortion(0.1)).unseen(disparity, camera)
    # Column 37 of the left image is reached at 7 of the right one, 102 px from its axis.
    assert right[90, 37]
    assert not right[90, 55]


def test_beyond_where_a_lens_turns_back_nothing_was_seen():
    # r - 0.5 r^3 is largest at a radius of 0.82 focal lengths.
    disparity = np.full(CAMERA.shape, 10, np.float32)
    unseen = Lenses(LensDistortion(-0.5)).unseen(disparity, CAMERA)
    radius = np.hypot(*CAMERA.rays())
    assert unseen[radius > 0.82].all()
    assert not unseen[radius < 0.7].any()
