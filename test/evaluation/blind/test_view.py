"""The truth of a view, and how it moves with the images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from blind_views import mismatch, rendered_view, tiny_view
from labelled import labelled_view

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.evaluation.blind.view import (
    View,
    exchanged,
    rotated_by_180,
    seen_from_the_right,
)
from rover_obstacle_detection.evaluation.vertical import angles_deg


def test_view_of_a_frame_keeps_its_truth_and_fits_the_other_image() -> None:
    frame = labelled_view()
    other = np.full((8, 6, 3), 70, np.uint8)
    view = View.of(frame, other, Gravity.from_angles(1.0))
    np.testing.assert_array_equal(view.left, frame.left)
    np.testing.assert_array_equal(view.labels, frame.labels)
    np.testing.assert_array_equal(view.depth_m, frame.depth_m)
    assert view.other.shape == frame.left.shape
    assert (view.other == 70).all()
    assert view.up == frame.gravity
    assert view.told_gravity is None
    assert view.blind is None


def test_view_of_a_frame_without_depth_and_gravity() -> None:
    up = Gravity.from_angles(30.0)
    frame = replace(labelled_view(), depth_m=None, gravity=None)
    view = View.of(frame, frame.right, up)
    assert np.isnan(view.depth_m).all()
    assert view.up == up


def test_truth_moves_by_the_disparity_into_the_right_image() -> None:
    labels, depth_m = seen_from_the_right(tiny_view())
    assert labels[0].tolist() == [0, 0, 1, 1, 0, 0, 0, 0, 255, 255]
    assert depth_m[1, :8].tolist() == [2.0] * 8
    assert np.isnan(depth_m[:, 8:]).all()


def test_nearest_surface_hides_the_others_in_the_right_image() -> None:
    view = tiny_view()
    depth_m = view.depth_m.copy()
    depth_m[0, 4:6] = 1.0
    labels, moved_m = seen_from_the_right(replace(view, depth_m=depth_m))
    # The rock's 4 px put it onto columns 0 and 1, in front of the wall's columns 2 and 3.
    assert labels[0].tolist() == [1, 1, 255, 255, 0, 0, 0, 0, 255, 255]
    assert moved_m[0, :2].tolist() == [1.0, 1.0]


def test_exchanged_images_match_with_the_opposite_sign() -> None:
    view = exchanged(rendered_view())
    mirrored = replace(
        view,
        left=view.left[:, ::-1],
        right=view.right[:, ::-1],
        depth_m=view.depth_m[:, ::-1],
    )
    assert mismatch(mirrored) < 0.2 * mismatch(view)


def test_turned_view_is_upside_down_in_every_part() -> None:
    view = replace(tiny_view(), up=Gravity.from_angles(30.0, 10.0))
    view = replace(view, camera=replace(view.camera, cx=3.0, cy=0.0, cx_right=2.0))
    turned = rotated_by_180(view)
    assert turned.left.tolist() == view.left[::-1, ::-1].tolist()
    assert turned.right.tolist() == view.right[::-1, ::-1].tolist()
    assert turned.labels[1].tolist() == view.labels[0, ::-1].tolist()
    assert (turned.camera.cx, turned.camera.cy, turned.camera.cx_right) == (6.0, 1.0, 7.0)
    assert turned.up is not None
    assert angles_deg(turned.up.up) == pytest.approx((30.0, -170.0))
    again = rotated_by_180(turned)
    assert again.left.tolist() == view.left.tolist()
    assert again.camera == view.camera
    assert again.up == view.up
