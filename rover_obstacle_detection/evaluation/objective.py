"""The score that tuning maximises over labelled scenes."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.results import mean_scene_iou
from rover_obstacle_detection.evaluation.weights import Weights


@dataclass(frozen=True)
class Terms:
    """Terms of the score, each a mean over scenes; every scene has the same weight.

    Parameters
    ----------
    mean_iou : float
        Mean IoU of the scenes with obstacles.
    missed_share : float
        Mean share of obstacles missed, of the scenes with obstacles large enough to count.
    false_alarms : float
        Mean false alarms per frame, of all scenes.
    """

    mean_iou: float
    missed_share: float
    false_alarms: float

    @classmethod
    def of(cls, scenes: Sequence[Figures]) -> Terms:
        """Compute the terms from figures of scenes, each pooled over its frames."""
        return cls(
            mean_iou=mean_scene_iou(scenes) or 0.0,
            missed_share=_mean(
                1 - each.obstacle_recall for each in scenes if each.obstacle_recall is not None
            ),
            false_alarms=_mean(
                each.false_alarms_per_frame
                for each in scenes
                if each.false_alarms_per_frame is not None
            ),
        )

    def score(self, weights: Weights) -> float:
        """Mean IoU minus the weighted errors; 1 is perfect."""
        return (
            self.mean_iou
            - weights.missed * self.missed_share
            - weights.false_alarm * self.false_alarms
        )


def score_of(scenes: Sequence[Figures], weights: Weights) -> float:
    """Score the figures of scenes; see `Terms`."""
    return Terms.of(scenes).score(weights)


def _mean(values: Iterable[float]) -> float:
    return statistics.fmean([*values] or [0.0])
