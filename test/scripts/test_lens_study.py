"""Frames with residual lens distortion, and the figures of detection on them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import waves
from labelled import labelled_view
from studies import lens_study
from studies.lens_study import (
    SceneLenses,
    compare_lenses,
    distorted_frame,
    lens_table,
    lenses_of,
)
from studies.scene_studies import study_lenses

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.rectification.lens_distortion import STRAIGHT_LENSES
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.labels import NOT_COUNTED

DISTORTION = (0.0, -0.04, 0.0), (0.0, 0.02, 0.0)

BAGS = Path(__file__).parents[2] / 'bags'


def test_shares_apply_at_the_farthest_corner():
    camera = labelled_view().camera
    lenses = lenses_of(camera, DISTORTION)
    x, y = camera.rays()
    radius = np.hypot(x, y)
    corner = np.unravel_index(radius.argmax(), radius.shape)
    assert lenses.left.stretch(x, y)[corner] == pytest.approx(-0.04, rel=1e-4)
    assert lenses.right.stretch(x, y)[corner] == pytest.approx(0.02, rel=1e-4)
    assert lenses_of(camera, ((0, 0, 0), (0, 0, 0))) == STRAIGHT_LENSES


def test_each_image_has_its_own_distortion_and_labels_follow_the_left_one():
    frame = labelled_view()
    lenses = lenses_of(frame.camera, DISTORTION)
    distorted = distorted_frame(frame, lenses)
    columns, rows = waves.straight_left(
        frame.camera, *np.meshgrid(np.arange(frame.camera.width), np.arange(frame.camera.height)),
        lenses.left,
    )  # fmt: skip
    inside = (columns >= 0) & (columns <= frame.camera.width - 1)
    inside &= (rows >= 0) & (rows <= frame.camera.height - 1)
    assert 0.5 < inside.mean() < 1
    assert (distorted.labels[~inside] == NOT_COUNTED).mean() > 0.99
    nearest = np.rint(rows[inside]).astype(int), np.rint(columns[inside]).astype(int)
    assert (distorted.labels[inside] == frame.labels[nearest]).mean() > 0.999
    assert (distorted.instances > 0).sum() == ((distorted.labels == 1) & inside).sum()
    assert np.abs(distorted.left.astype(float)[inside] - frame.left[nearest]).mean() < 15
    _, right_view = lenses.views(frame.camera)
    places = right_view.straight_places(RectificationParameters())
    columns, rows = (np.rint(np.nan_to_num(each, nan=-1)).astype(int) for each in places)
    inside = (columns >= 0) & (columns < frame.camera.width)
    inside &= (rows >= 0) & (rows < frame.camera.height)
    nearest = rows[inside], columns[inside]
    assert np.abs(distorted.right.astype(float)[inside] - frame.right[nearest]).mean() < 15
    assert not np.array_equal(distorted.left, frame.left)
    assert not np.array_equal(distorted.right, frame.right)


def test_no_distortion_leaves_the_frame_unchanged():
    frame = labelled_view()
    same = distorted_frame(frame, STRAIGHT_LENSES)
    for name in ('left', 'right', 'labels', 'instances'):
        np.testing.assert_array_equal(getattr(same, name), getattr(frame, name))


def test_correction_recovers_the_obstacles(monkeypatch):
    distortions = {'none': ((0,) * 3, (0,) * 3), 'distorted': DISTORTION}
    monkeypatch.setattr(lens_study, 'DISTORTIONS', distortions)
    frame = labelled_view()
    found = compare_lenses(frame, DetectorConfig())
    assert found.uncorrected['none'] == found.corrected['none']
    assert found.corrected['distorted'].iou > 0.6
    assert found.corrected['distorted'].iou > found.uncorrected['distorted'].iou + 0.1


def test_bag_is_studied_with_each_distortion(monkeypatch):
    monkeypatch.setattr(lens_study, 'DISTORTIONS', {'distorted': DISTORTION})
    (frame,) = study_lenses(BAGS / 'simulated_vga_moon', DetectorConfig())
    assert frame.corrected['distorted'].frames == 1
    assert frame.corrected['distorted'].iou > 0.6
    assert frame.corrected['distorted'].iou > frame.uncorrected['distorted'].iou


def test_table_has_a_row_for_each_distortion(monkeypatch):
    monkeypatch.setattr(lens_study, 'DISTORTIONS', {'a': DISTORTION, 'b': DISTORTION})
    poor = Figures(frames=1, true_positives=1, false_negatives=3, rocks=2, false_alarms=1)
    good = Figures(frames=1, true_positives=3, false_negatives=1, rocks=2, rocks_found=2)
    scenes = [SceneLenses({'a': poor, 'b': good}, {'a': good, 'b': good})] * 2
    table = lens_table(scenes)
    assert table.header[0] == 'distortion'
    assert table.rows == [
        ('a', '0.250', '0/4', '1.00', '0.750', '4/4', '0.00'),
        ('b', '0.750', '4/4', '0.00', '0.750', '4/4', '0.00'),
    ]
