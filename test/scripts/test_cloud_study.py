"""Obstacle clouds against the truth: counts worked out by hand, and the sample bags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from studies.cloud_study import CloudErrors, SceneClouds, cloud_table
from studies.scene_studies import study_clouds

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.frame import LabelledFrame

BAGS = Path(__file__).parents[2] / 'bags'
CAMERA = StereoCamera(40, 30, 40.0, 40.0, 19.5, 14.5, 0.1)
# The camera looks down, so that cells lie in the image plane: 0.05 m are 1 pixel at 2 m.
UP = (0.0, -0.01, -0.99995)


def frame(depth_m):
    """A rock of 4 x 4 pixels in the middle."""
    labels = np.zeros(CAMERA.shape, np.uint8)
    labels[13:17, 18:22] = 1
    grey = np.zeros(CAMERA.shape, np.uint8)
    return LabelledFrame(0, CAMERA, grey, grey, labels, labels.astype(np.uint16), depth_m)


def points_at(pixels, depth_m):
    x, y = CAMERA.rays()
    return np.array([(x[0, u] * depth_m, y[v, 0] * depth_m, depth_m) for v, u in pixels], 'f4')


@pytest.mark.parametrize(('depth_m', 'wrong'), [(2.1, 0), (1.9, 0), (2.25, 2), (1.75, 2)])
def test_points_at_another_depth_are_wrong(depth_m, wrong):
    truth = frame(np.full(CAMERA.shape, 2.0, np.float32))
    found = CloudErrors.of(points_at([(14, 19), (15, 20)], depth_m), truth, UP)
    assert (found.points, found.wrong) == (2, wrong)


def test_far_points_may_be_off_by_a_share_of_their_depth():
    truth = frame(np.full(CAMERA.shape, 20.0, np.float32))
    found = CloudErrors.of(points_at([(14, 19)], 20.9), truth, UP)
    assert found == CloudErrors(points=1, wrong=0, cells=0, false=0), 'not near'


def test_cells_away_from_the_rock_are_false():
    truth = frame(np.full(CAMERA.shape, 2.0, np.float32))
    on_it = [(14, 19), (14, 19), (15, 20)]
    beside_it = [(15, 24), (15, 30), (2, 20)]
    found = CloudErrors.of(points_at([*on_it, *beside_it], 2.0), truth, UP)
    assert (found.cells, found.false) == (5, 2), '(15, 24) is within 0.15 m'


def test_no_points_have_no_errors():
    truth = frame(np.full(CAMERA.shape, 2.0, np.float32))
    assert CloudErrors.of(np.zeros((0, 3), np.float32), truth, UP) == CloudErrors()


def test_the_table_has_a_row_for_each_scene_and_their_sum():
    one = SceneClouds('one', CloudErrors(100, 20, 30, 10), CloudErrors(110, 5, 28, 2))
    two = SceneClouds('two', CloudErrors(1, 0, 1, 0), CloudErrors(1, 0, 1, 0))
    assert [tuple(row) for row in cloud_table([one, two]).rows] == [
        ('one', '100 -> 110', '20 -> 5', '30 -> 28', '10 -> 2'),
        ('two', '1 -> 1', '0 -> 0', '1 -> 1', '0 -> 0'),
        ('all', '101 -> 111', '20 -> 5', '31 -> 29', '10 -> 2'),
    ]


def test_published_clouds_of_rocks_have_few_false_cells():
    found = [
        study_clouds(BAGS / name, DetectorConfig())
        for name in ('mars_yard', 'simulated_study_noon', 'simulated_vga_moon')
    ]
    plain = sum((each.plain for each in found), CloudErrors())
    published = sum((each.published for each in found), CloudErrors())
    assert plain.false > 50
    assert published.false < 0.4 * plain.false
    assert published.wrong / published.points < plain.wrong / plain.points
    assert published.points > 0.97 * plain.points
    assert published.cells - published.false > 0.93 * (plain.cells - plain.false)


def test_published_clouds_of_slopes_have_no_more_false_cells():
    found = study_clouds(BAGS / 'simulated_hazcam_crater', DetectorConfig())
    assert found.published.false <= found.plain.false
    assert found.published.wrong < found.plain.wrong
