"""Ground-truth disparity and visibility, worked out by hand."""

from __future__ import annotations

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.true_disparity import true_disparity, visible_in_both

CAMERA = StereoCamera(10, 1, 20.0, 20.0, 4.5, 0.0, 0.5)


def row(*values: float) -> np.ndarray:
    return np.array([values], np.float32)


def test_disparity_from_depth() -> None:
    disparity = true_disparity(row(2.0, np.nan), CAMERA)
    assert disparity[0, 0] == 5.0
    assert np.isnan(disparity[0, 1])


def test_pixels_outside_or_occluded_in_the_right_image() -> None:
    # A block of 5 px in front of a wall of 2 px hides columns 2 and 3; 0 and 1 are outside.
    truth = row(2, 2, 2, 2, 2, 5, 5, 2, np.nan, 2)
    assert visible_in_both(truth, CAMERA)[0].tolist() == [
        False, False, False, False, True, True, True, True, False, True,
    ]  # fmt: skip


def test_disparity_offset_shifts_the_right_image() -> None:
    shifted = StereoCamera(10, 1, 20.0, 20.0, 4.5, 0.0, 0.5, cx_right=6.5)
    truth = row(*[3.0] * 10)
    assert visible_in_both(truth, CAMERA)[0].sum() == 7
    assert visible_in_both(truth, shifted)[0].sum() == 9
