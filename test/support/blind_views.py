"""Views for the blind conditions."""

from __future__ import annotations

import numpy as np
from labelled import labelled_view

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.blind.view import View
from rover_obstacle_detection.evaluation.true_disparity import true_disparity


def tiny_view(**changes) -> View:
    """A wall at 2 m in ten columns and two rows, with a disparity of 2 px; two pixels of rock."""
    camera = StereoCamera(10, 2, 8.0, 8.0, 4.5, 0.5, 0.5)
    left = np.arange(20, dtype=np.uint8).reshape(2, 10) * 10 + 20
    labels = np.zeros((2, 10), np.uint8)
    labels[0, 4:6] = 1
    fields = {
        'left': left,
        'right': np.roll(left, -2, axis=1),
        'camera': camera,
        'labels': labels,
        'depth_m': np.full((2, 10), 2.0, np.float32),
        'other': np.full((2, 10), 99, np.uint8),
    }
    return View(**{**fields, **changes})


def rendered_view() -> View:
    """A box on ground, with exact depth."""
    frame = labelled_view()
    return View.of(frame, frame.right[::-1, ::-1].copy())


def mismatch(view: View) -> float:
    """Median grey-level difference between left pixels and their true right counterparts."""
    disparity = true_disparity(view.depth_m, view.camera) + view.camera.disparity_offset
    rows, columns = np.nonzero(np.isfinite(disparity))
    target = np.rint(columns - disparity[rows, columns]).astype(int)
    inside = (target >= 0) & (target < view.camera.width)
    rows, columns, target = rows[inside], columns[inside], target[inside]
    difference = view.left[rows, columns].astype(float) - view.right[rows, target]
    return float(np.median(np.abs(difference)))
