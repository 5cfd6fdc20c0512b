"""What `Detector.detect` takes: against plain SGBM, by stage, by working scale, by listing.

All times are those of plain SGBM and of the detector in turns, in one process.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from benchmark_scenes import STANDARD, Pair, Scene, plain_seconds, standard_scenes
from effort import Effort
from findings import Findings, Line, at_least, at_most

from rover_obstacle_detection import Detector, DetectorConfig
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.methods.registry import make_method
from rover_obstacle_detection.evaluation.tables import Table, number

CLOUDS = 'clouds and obstacles, on request'
DEFAULT_SCALE = 0.0
MEDIAN_GOAL, WORST_GOAL, LISTING_GOAL = 1.0, 2.0, 50.0


@dataclass(frozen=True)
class PairTimes:
    """Medians over the turns of one pair."""

    ratio: float
    """To plain SGBM in the same turn."""
    seconds: float
    plain_seconds: float
    stages: dict[str, tuple[float, float]]
    """Ratio to plain SGBM, and seconds."""
    figures: Figures | None
    """What the mask is worth, where there are labels."""


@dataclass
class _Turns:
    """The times of each turn."""

    seconds: list[float] = field(default_factory=list)
    plain: list[float] = field(default_factory=list)
    stages: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    def ratio(self, seconds: Sequence[float]) -> float:
        """Median ratio of times to plain SGBM in the same turn."""
        return statistics.median(
            own / plain for own, plain in zip(seconds, self.plain, strict=True)
        )


def detection_findings(scenes: Sequence[Scene], effort: Effort) -> Findings:
    """Measure all scenes at the default scale, those of 1024 x 768 also at fixed ones."""
    standard = standard_scenes(scenes)
    default = [measured(scene.pair, DEFAULT_SCALE, effort.turns) for scene in standard]
    others = [
        measured(scene.pair, DEFAULT_SCALE, effort.turns)
        for scene in scenes
        if scene.size != STANDARD
    ]
    by_scale = {
        scale: default
        if scale == DEFAULT_SCALE
        else [measured(scene.pair, scale, effort.turns) for scene in standard]
        for scale in effort.scales
    }
    lines = (
        *ratio_lines(default),
        *smaller_lines(others),
        listing_line(standard[: effort.listing_pairs], default),
    )
    return Findings(lines, {'stages': stage_table(default), 'curve': curve_table(by_scale)})


def measured(pair: Pair, scale: float, turns: int) -> PairTimes:
    """Detect in one pair at one scale, in turns with plain SGBM."""
    detector = Detector(pair.camera, DetectorConfig(working_scale=scale))
    taken = _Turns()
    # The first turn is a warm-up.
    found = _turn(pair, detector, _Turns())
    for _ in range(turns):
        found = _turn(pair, detector, taken)
    return PairTimes(
        ratio=taken.ratio(taken.seconds),
        seconds=statistics.median(taken.seconds),
        plain_seconds=statistics.median(taken.plain),
        stages={
            stage: (taken.ratio(seconds), statistics.median(seconds))
            for stage, seconds in taken.stages.items()
        },
        figures=score(found.mask, pair.labels, pair.instances, found.known)
        if isinstance(pair, LabelledFrame)
        else None,
    )


def _turn(pair: Pair, detector: Detector, taken: _Turns) -> Detection:
    taken.plain.append(plain_seconds(pair))
    laps: dict[str, float] = defaultdict(float)
    began = last = time.perf_counter()

    def lap(stage: str) -> None:
        nonlocal last
        now = time.perf_counter()
        laps[stage] += now - last
        last = now

    found = detector.detect(pair.left, pair.right, on_stage=lap)
    taken.seconds.append(time.perf_counter() - began)
    last = time.perf_counter()
    _ = found.obstacle_points, found.ground_points, found.obstacles
    lap(CLOUDS)
    for stage, seconds in laps.items():
        taken.stages[stage].append(seconds)
    return found


def ratio_lines(times: Sequence[PairTimes]) -> tuple[Line, ...]:
    """Lines of the time at 1024 x 768 against plain SGBM."""
    ratios = [each.ratio for each in times]
    name = f'detection at {STANDARD[0]} x {STANDARD[1]}'
    return (
        at_most(f'{name}, median of {len(times)} scenes', statistics.median(ratios), MEDIAN_GOAL),
        at_most(f'{name}, worst scene', max(ratios), WORST_GOAL),
        Line(f'{name}, median', f'{median_ms(each.seconds for each in times):.0f} ms'),
        Line(
            f'plain SGBM at {STANDARD[0]} x {STANDARD[1]}, median',
            f'{median_ms(each.plain_seconds for each in times):.0f} ms',
        ),
    )


def smaller_lines(times: Sequence[PairTimes]) -> tuple[Line, ...]:
    """Line of the scenes of other sizes, against plain SGBM on the same small images."""
    if not times:
        return ()
    ratios = [each.ratio for each in times]
    figures = (
        f'{statistics.median(ratios):.2f} x its own SGBM, worst {max(ratios):.2f}; '
        f'{median_ms(each.seconds for each in times):.0f} ms'
    )
    return (Line(f'detection in smaller images, median of {len(times)} scenes', figures),)


def median_ms(seconds: Iterable[float]) -> float:
    """Median in milliseconds."""
    return 1000 * statistics.median(seconds)


def listing_line(scenes: Sequence[Scene], times: Sequence[PairTimes]) -> Line:
    """Compare with the study's code as printed, by the total time on some scenes."""
    listing = make_method('listing')
    began = time.perf_counter()
    for scene in scenes:
        listing(scene.pair.camera, scene.pair.left, scene.pair.right)
    seconds = time.perf_counter() - began
    own_seconds = sum(each.seconds for each in times[: len(scenes)])
    what = f"speed relative to the study's listing, {len(scenes)} scenes"
    return at_least(what, seconds / own_seconds, LISTING_GOAL, '{:.0f} x')


def stage_table(times: Sequence[PairTimes]) -> Table:
    """Tabulate the mean time of each stage over the scenes."""
    stages = list(dict.fromkeys(stage for each in times for stage in each.stages))
    rows = []
    for stage in stages:
        taken = [each.stages.get(stage, (0.0, 0.0)) for each in times]
        ratio = statistics.fmean(ratio for ratio, _ in taken)
        seconds = statistics.fmean(seconds for _, seconds in taken)
        rows.append((stage, f'{ratio:.2f}', f'{1000 * seconds:.1f}'))
    return Table('Stages', ('stage', 'x SGBM', 'ms'), rows)


def curve_table(by_scale: dict[float, list[PairTimes]]) -> Table:
    """Tabulate time and accuracy over the working scale."""
    rows = []
    for scale, times in by_scale.items():
        ratios = [each.ratio for each in times]
        figures = [each.figures for each in times if each.figures is not None]
        ious = [each.iou for each in figures if each.iou is not None]
        total = sum(figures, Figures())
        rows.append(
            (
                '0: follows the step (default)' if scale == DEFAULT_SCALE else f'{scale:g}',
                f'{statistics.median(ratios):.2f}',
                f'{max(ratios):.2f}',
                f'{median_ms(each.seconds for each in times):.0f}',
                number(statistics.fmean(ious) if ious else None),
                number(min(ious, default=None)),
                f'{total.obstacles_found}/{total.obstacles}',
                str(total.false_alarms),
            )
        )
    header = (
        '`working_scale`',
        'x SGBM, median',
        'worst',
        'ms',
        'mean IoU',
        'worst IoU',
        'obstacles found',
        'false alarms',
    )
    return Table('Accuracy over time', header, rows)
