from __future__ import annotations

import itertools

import numpy as np
import pytest
from hand_made import small_detection
from studies.reliability import (
    EDGES,
    JudgedObstacles,
    judge,
    reliability,
    reliability_table,
)


def judged(confidence, real):
    return JudgedObstacles(np.asarray(confidence, np.float64), np.asarray(real, bool))


def test_obstacle_is_real_if_half_of_its_counted_pixels_lie_on_obstacles():
    numbers = np.zeros((6, 10), np.int32)
    for number in range(5):
        numbers[number, :8] = number + 1
    labels = np.zeros((6, 10), np.uint8)
    labels[0, :4] = 1  # half of it rock
    labels[1, :3] = 2  # three eighths slope
    labels[2, :2], labels[2, 4:8] = 3, 255  # half of the counted ones drop
    labels[3, :8] = 255  # nothing counted
    labels[4, :5] = 255  # less than half counted
    is_real, is_judged = judge(numbers, labels)
    assert is_judged.tolist() == [True, True, True, False, False]
    assert is_real[is_judged].tolist() == [True, False, True]


def test_no_obstacles_are_judged_in_an_empty_frame():
    is_real, is_judged = judge(np.zeros((4, 5), np.int32), np.zeros((4, 5), np.uint8))
    assert is_real.shape == is_judged.shape == (0,)


def test_obstacles_of_a_detection_keep_their_confidence():
    detection = small_detection()
    labels = np.where(detection.mask > 0, 1, 0).astype(np.uint8)
    found = JudgedObstacles.of(detection, labels)
    assert found.real.tolist() == [True]
    assert found.confidence == pytest.approx([detection.obstacles[0].confidence])
    free = JudgedObstacles.of(detection, np.zeros_like(labels))
    assert free.real.tolist() == [False]
    unjudged = JudgedObstacles.of(detection, np.full_like(labels, 255))
    assert len(unjudged.real) == len(unjudged.confidence) == 0


def test_adding_judged_obstacles_concatenates_them():
    both = judged([0.2], [False]) + judged([0.9, 0.8], [True, False])
    assert both.confidence.tolist() == [0.2, 0.9, 0.8]
    assert both.real.tolist() == [False, True, False]


def test_bins_include_their_lower_edge():
    bins = reliability(judged([0.0, 0.05, 0.1, 0.29, 0.95, 1.0], [0, 1, 0, 1, 1, 1]))
    assert [(each.low, each.high) for each in bins] == list(itertools.pairwise(EDGES))
    assert [each.count for each in bins] == [2, 2, 0, 0, 0, 2]
    first, second, third, *_, last = bins
    assert first.mean_confidence == pytest.approx(0.025)
    assert first.share_real == pytest.approx(0.5)
    assert second.mean_confidence == pytest.approx(0.195)
    assert (third.mean_confidence, third.share_real) == (None, None)
    assert last.mean_confidence == pytest.approx(0.975)
    assert last.share_real == 1


def test_edges_can_be_chosen():
    bins = reliability(judged([0.4, 0.6], [0, 1]), edges=(0, 0.5, 1))
    assert [(each.count, each.share_real) for each in bins] == [(1, 0), (1, 1)]


def test_calibration_error_and_brier_score():
    obstacles = judged([0.05] * 4 + [0.95] * 4, [0, 0, 0, 1, 1, 1, 1, 1])
    assert obstacles.calibration_error() == pytest.approx((4 * 0.2 + 4 * 0.05) / 8)
    assert obstacles.brier_score() == pytest.approx((3 * 0.05**2 + 0.95**2 + 4 * 0.05**2) / 8)


def test_separation_is_the_area_under_the_roc():
    assert judged([0.1, 0.2, 0.8, 0.9], [0, 0, 1, 1]).separation() == 1
    assert judged([0.1, 0.8, 0.2, 0.9], [0, 0, 1, 1]).separation() == 0.75
    assert judged([0.5, 0.5], [0, 1]).separation() == 0.5


@pytest.mark.parametrize('obstacles', [judged([], []), judged([0.4, 0.7], [1, 1])])
def test_separation_needs_real_and_false_obstacles(obstacles):
    assert obstacles.separation() is None


def test_no_obstacles_have_no_figures():
    nothing = judged([], [])
    assert nothing.calibration_error() is None
    assert nothing.brier_score() is None
    assert [each.count for each in reliability(nothing)] == [0] * (len(EDGES) - 1)


def test_table_has_a_row_for_each_bin_and_one_for_all():
    obstacles = judged([0.05, 0.07, 0.95, 0.97], [0, 1, 1, 1])
    table = reliability_table('hybrid, reported', obstacles)
    assert table.title == 'hybrid, reported'
    assert table.header == ('confidence', 'obstacles', 'mean confidence', 'share real')
    assert table.rows[0] == ('0 to 0.1', '2', '0.060', '0.500')
    assert table.rows[1] == ('0.1 to 0.3', '0', '-', '-')
    assert table.rows[-2] == ('0.9 to 1', '2', '0.960', '1.000')
    assert table.rows[-1] == ('all', '4', '0.510', '0.750')
    assert len(table.rows) == len(EDGES)
