"""What each change does to a view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from blind_views import mismatch, rendered_view, tiny_view

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.evaluation.blind import changes
from rover_obstacle_detection.evaluation.vertical import angles_deg


def blind_share(view) -> float:
    return float(view.blind.mean())


def test_flat_images_say_nothing_anywhere() -> None:
    view = tiny_view()
    both = changes.both_flat(view, 16)
    assert (both.left == 16).all()
    assert (both.right == 16).all()
    noisy = changes.both_flat(view, 100, sigma=4)
    assert not np.array_equal(noisy.left, noisy.right)
    right = changes.right_flat(view, 255)
    np.testing.assert_array_equal(right.left, view.left)
    assert (right.right == 255).all()
    assert blind_share(both) == blind_share(right) == 1.0


def test_same_image_twice() -> None:
    view = tiny_view()
    left = changes.same_image(view, 'left')
    np.testing.assert_array_equal(left.left, view.left)
    np.testing.assert_array_equal(left.right, view.left)
    np.testing.assert_array_equal(left.labels, view.labels)
    right = changes.same_image(view, 'right')
    np.testing.assert_array_equal(right.left, view.right)
    np.testing.assert_array_equal(right.right, view.right)
    assert right.labels[0].tolist() == [0, 0, 1, 1, 0, 0, 0, 0, 255, 255]
    noisy = changes.same_image(view, 'left', sigma=2.0)
    assert not np.array_equal(noisy.left, noisy.right)
    assert blind_share(left) == 1.0


def test_right_image_of_another_moment() -> None:
    view = tiny_view()
    assert (changes.other_moment(view).right == 99).all()
    assert changes.mirrored_left(view).right[0].tolist() == view.left[0, ::-1].tolist()
    torn = changes.torn_right(view, 0.5)
    np.testing.assert_array_equal(torn.right[0], view.right[0])
    assert (torn.right[1] == 99).all()
    assert torn.blind is not None
    assert torn.blind.all(axis=1).tolist() == [False, True]
    closer = changes.moved_on(rendered_view(), 1.1)
    assert mismatch(closer) > 2 * mismatch(rendered_view())
    assert closer.blind is None


def test_rows_lost_are_black_and_in_the_middle() -> None:
    view = rendered_view()
    height = view.right.shape[0]
    lost = changes.rows_lost(view, 0.25)
    assert lost.blind is not None
    rows = np.flatnonzero(lost.blind.all(axis=1))
    assert len(rows) == pytest.approx(height / 4, abs=1)
    assert rows.mean() == pytest.approx((height - 1) / 2)
    assert (lost.right[rows] == 0).all()
    np.testing.assert_array_equal(lost.right[~lost.blind], view.right[~lost.blind])


@pytest.mark.parametrize('change', [changes.defocused, changes.smeared])
def test_sides_are_damaged_as_named(change) -> None:
    view = rendered_view()
    left, right, both = (change(view, side, 5) for side in ('left', 'right', 'both'))
    np.testing.assert_array_equal(left.right, view.right)
    np.testing.assert_array_equal(right.left, view.left)
    np.testing.assert_array_equal(both.left, left.left)
    np.testing.assert_array_equal(both.right, right.right)
    for damaged, image in ((left.left, view.left), (right.right, view.right)):
        assert np.diff(damaged.astype(float)).std() < 0.7 * np.diff(image.astype(float)).std()


def test_cover_and_dirt_are_on_the_left_lens_and_blind() -> None:
    view = rendered_view()
    covered = changes.covered_left(view, 0.25)
    assert blind_share(covered) == pytest.approx(0.25, abs=0.01)
    assert covered.blind is not None
    assert covered.blind[:, -1].all()
    assert covered.left[covered.blind].mean() < 10
    np.testing.assert_array_equal(covered.right, view.right)
    dirty = changes.dirty_left(view, 0.4)
    assert 0.2 < blind_share(dirty) < 0.4
    np.testing.assert_array_equal(dirty.right, view.right)


def test_clipped_areas_are_blind() -> None:
    view = rendered_view()
    white, black = changes.over_exposed(view, 100), changes.under_exposed(view, 0.0)
    assert blind_share(white) > 0.9
    assert (white.left[white.blind] == 255).all()
    assert blind_share(black) > 0.9
    assert blind_share(changes.over_exposed(view, 1.0)) < 0.1


def test_both_images_are_damaged() -> None:
    view = rendered_view()
    damaged = changes.foggy(view, 0.1), changes.noisy(view, 40), changes.jpeg(view, 3)
    for each in damaged:
        for name in ('left', 'right'):
            difference = getattr(each, name).astype(float) - getattr(view, name)
            assert np.abs(difference).mean() > 3


def test_shift_changes_the_match_by_as_much() -> None:
    view = rendered_view()
    shifted = changes.shifted_right_image(view, columns=6)
    assert mismatch(shifted) > 2 * mismatch(view)
    # The calibration that would be right for the shifted image.
    told = replace(shifted.camera, cx_right=shifted.camera.cx + 6)
    assert mismatch(replace(shifted, camera=told)) == pytest.approx(mismatch(view), abs=1)
    low = changes.shifted_right_image(view, rows=4)
    np.testing.assert_array_equal(low.right[4:], view.right[:-4])


def test_wrong_calibration_is_told_and_images_stay() -> None:
    view = tiny_view()
    assert changes.wrong_principal_point(view, 5.0).camera.disparity_offset == -5.0
    assert changes.wrong_baseline(view, 10).camera.baseline_m == 5.0
    focal = changes.wrong_focal_length(view, 2).camera
    assert (focal.fx, focal.fy) == (16.0, 16.0)
    for changed in (changes.wrong_baseline(view, 10), changes.wrong_focal_length(view, 2)):
        assert changed.left is view.left
        assert changed.depth_m is view.depth_m


def test_upside_down_camera_is_a_valid_pair_with_its_truth() -> None:
    view = rendered_view()
    view = replace(view, camera=replace(view.camera, cx_right=view.camera.cx + 3))
    shifted = replace(view, right=np.roll(view.right, 3, axis=1))
    turned = changes.upside_down(shifted)
    assert mismatch(turned) == pytest.approx(mismatch(shifted), abs=1)
    assert turned.camera.cx_right is not None
    confused = replace(turned.camera, cx=turned.camera.cx_right, cx_right=turned.camera.cx)
    assert mismatch(replace(turned, camera=confused)) > 2 * mismatch(turned)
    assert turned.left.tolist() == shifted.right[::-1, ::-1].tolist()
    assert turned.camera.cx == view.camera.width - 1 - view.camera.cx - 3
    assert 0 < (turned.labels == 1).sum() <= (view.labels == 1).sum() * 1.1
    single = changes.right_upside_down(view)
    assert single.right.tolist() == view.right[::-1, ::-1].tolist()
    assert blind_share(single) == 1.0


def test_told_vertical_is_off_by_its_angles() -> None:
    view = replace(tiny_view(), up=Gravity.from_angles(30.0, 5.0))
    told = changes.told_vertical(view, pitch_error_deg=-20.0)
    assert told is not None
    assert told.told_gravity is not None
    assert angles_deg(told.told_gravity.up) == pytest.approx((10.0, 5.0))
    rolled = changes.told_vertical(view, roll_error_deg=40.0)
    assert rolled is not None
    assert rolled.told_gravity is not None
    assert angles_deg(rolled.told_gravity.up) == pytest.approx((30.0, 45.0))
    level = changes.told_level(view).told_gravity
    assert level is not None
    assert angles_deg(level.up) == pytest.approx((0.0, 0.0))
    assert changes.told_vertical(tiny_view()) is None
