"""The tuning score."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.objective import Terms, score_of
from rover_obstacle_detection.evaluation.results import total
from rover_obstacle_detection.evaluation.weights import Weights

EMPTY = Figures(frames=1, true_negatives=100)


def scene(hit: int, missed: int, found: int, rocks: int, **others: int) -> Figures:
    return Figures(
        **{'frames': 1, **others},
        true_positives=hit,
        false_negatives=missed,
        rocks=rocks,
        rocks_found=found,
    )


def test_perfect_score_is_1() -> None:
    assert score_of([scene(50, 0, 2, 2), EMPTY], Weights()) == 1.0


def test_blind_detector_pays_for_every_miss() -> None:
    assert score_of([scene(0, 50, 0, 2), EMPTY], Weights(missed=0.3)) == pytest.approx(-0.3)


def test_each_term_is_a_mean_over_scenes() -> None:
    scenes = [
        scene(60, 40, 1, 2, frames=10, false_alarms=20),
        scene(80, 20, 9, 10, frames=1),
        Figures(frames=2, true_negatives=9, false_alarms=2),
    ]
    terms = Terms.of(scenes)
    assert terms.mean_iou == pytest.approx((0.6 + 0.8) / 2)
    assert terms.missed_share == pytest.approx((0.5 + 0.1) / 2)
    assert terms.false_alarms == pytest.approx((2 + 0 + 1) / 3)
    assert terms.score(Weights(missed=2.0, false_alarm=0.1)) == pytest.approx(0.7 - 0.6 - 0.1)


def test_scene_with_small_obstacles_only_counts_by_pixels() -> None:
    terms = Terms.of([scene(30, 70, 0, 0)])
    assert terms.mean_iou == pytest.approx(0.3)
    assert terms.missed_share == 0.0


def test_empty_scenes_count_for_false_alarms_only() -> None:
    assert Terms.of([EMPTY]) == Terms(mean_iou=0.0, missed_share=0.0, false_alarms=0.0)


@given(st.integers(0, 50), st.integers(0, 5), st.integers(1, 20))
def test_number_of_frames_does_not_change_the_score(hit: int, alarms: int, frames: int) -> None:
    one = scene(hit, 50 - hit, 1, 2, false_alarms=alarms)
    many = total([one] * frames)
    other = scene(10, 30, 1, 1)
    assert score_of([many, other], Weights()) == pytest.approx(score_of([one, other], Weights()))
