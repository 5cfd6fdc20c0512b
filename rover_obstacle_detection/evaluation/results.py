"""Results of methods on labelled scenes."""

from __future__ import annotations

import functools
import operator
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from rover_obstacle_detection.evaluation.distributions import TerrainDistributions
from rover_obstacle_detection.evaluation.faults import Fault
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.losses import Losses


@dataclass(frozen=True)
class FrameResult:
    """Result of one method on one frame.

    Parameters
    ----------
    stamp_ns : int
    figures : Figures
    seconds : float
        Run time of the method.
    plain_seconds : float
        Run time of one plain SGBM call on the same pair.
    losses : Losses, optional
        Like the fields below, only filled in when pictures are kept.
    faults : tuple of Fault
        Missed obstacles and false alarms, largest first.
    remarks : tuple of str
        Errors of the frame as a whole.
    """

    stamp_ns: int
    figures: Figures
    seconds: float
    plain_seconds: float
    losses: Losses | None = None
    faults: tuple[Fault, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Picture:
    """JPEG of the hits, misses and false positives of one method in one frame."""

    method: str
    scene: str
    frame: FrameResult
    jpeg: bytes = field(repr=False)

    @property
    def wrongness(self) -> tuple[float, float]:
        """Sort key: number of faults, then 1 - IoU."""
        iou = self.frame.figures.iou
        return len(self.frame.faults), 0.0 if iou is None else 1 - iou


@dataclass(frozen=True)
class SceneResult:
    """Result of one method on all frames of one scene."""

    method: str
    scene: str
    conditions: tuple[str, ...]
    frames: tuple[FrameResult, ...]
    by_range: tuple[Figures, ...] = ()

    @property
    def figures(self) -> Figures:
        """Figures pooled over the frames."""
        return total(frame.figures for frame in self.frames)

    @property
    def median_seconds(self) -> float:
        """Median time per frame."""
        return statistics.median(frame.seconds for frame in self.frames)

    @property
    def times_plain(self) -> float:
        """Median time relative to that of one plain SGBM call."""
        return self.median_seconds / statistics.median(
            frame.plain_seconds for frame in self.frames
        )


@dataclass(frozen=True)
class Evaluation:
    """Results of all methods on all scenes.

    Parameters
    ----------
    scenes : tuple of SceneResult
    curves : mapping of str to mapping of float to Figures
        Pooled figures by ``max_step``, for each method that depends on it.
    distributions : mapping of str to TerrainDistributions
        For each method that measures terrain.
    pictures : tuple of Picture
        Worst frames of each method.
    problems : tuple of str
        One line for each frame or message that could not be used.
    """

    scenes: tuple[SceneResult, ...] = ()
    curves: Mapping[str, Mapping[float, Figures]] = field(default_factory=dict)
    distributions: Mapping[str, TerrainDistributions] = field(default_factory=dict)
    pictures: tuple[Picture, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods, in the order of the results."""
        return tuple(dict.fromkeys(result.method for result in self.scenes))

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions, in alphabetical order."""
        return tuple(sorted({name for result in self.scenes for name in result.conditions}))

    def of(self, method: str, condition: str | None = None) -> tuple[SceneResult, ...]:
        """Results of a method on all scenes, or on those with a condition."""
        return tuple(
            result
            for result in self.scenes
            if result.method == method and (condition is None or condition in result.conditions)
        )

    def by_range(self, method: str) -> tuple[Figures, ...]:
        """Pooled figures of a method by distance; empty without depth."""
        known = [result.by_range for result in self.of(method) if result.by_range]
        return tuple(total(spans) for spans in zip(*known, strict=True))


def total(figures: Iterable[Figures]) -> Figures:
    """Pool figures."""
    return functools.reduce(operator.add, figures, Figures())


def mean_iou(results: Sequence[SceneResult]) -> float | None:
    """Mean IoU of the scenes with obstacles; see `mean_scene_iou`."""
    return mean_scene_iou(result.figures for result in results)


def mean_scene_iou(scenes: Iterable[Figures]) -> float | None:
    """Mean IoU of the scenes with obstacles, each pooled over its frames; None without any."""
    values = [
        figures.iou for figures in scenes if figures.obstacle_pixels and figures.iou is not None
    ]
    return statistics.fmean(values) if values else None


def worst_condition(evaluation: Evaluation, method: str) -> tuple[str, float] | None:
    """Find the condition with the lowest mean IoU."""
    known = [
        (condition, value)
        for condition in evaluation.conditions
        if (value := mean_iou(evaluation.of(method, condition))) is not None
    ]
    return min(known, key=lambda each: each[1], default=None)


def merged(evaluations: Iterable[Evaluation], worst_pictures: int) -> Evaluation:
    """Combine evaluations, keeping the worst pictures of each method."""
    parts = list(evaluations)
    curves: dict[str, dict[float, Figures]] = {}
    distributions: dict[str, TerrainDistributions] = {}
    for part in parts:
        for method, curve in part.curves.items():
            sums = curves.setdefault(method, {})
            for max_step_m, figures in curve.items():
                sums[max_step_m] = sums.get(max_step_m, Figures()) + figures
        for method, both in part.distributions.items():
            known = distributions.get(method)
            distributions[method] = both if known is None else known + both
    return Evaluation(
        scenes=tuple(result for part in parts for result in part.scenes),
        curves=curves,
        distributions=distributions,
        pictures=worst([picture for part in parts for picture in part.pictures], worst_pictures),
        problems=tuple(problem for part in parts for problem in part.problems),
    )


def worst(pictures: Sequence[Picture], count: int) -> tuple[Picture, ...]:
    """Select the worst pictures of each method, worst first."""
    kept: list[Picture] = []
    for method in dict.fromkeys(picture.method for picture in pictures):
        own = [picture for picture in pictures if picture.method == method]
        kept += sorted(own, key=lambda picture: picture.wrongness, reverse=True)[:count]
    return tuple(kept)
