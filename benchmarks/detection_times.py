"""What `Detector.detect` takes: against plain SGBM, by stage, by resolution, by listing.

All times are those of plain SGBM and of the detector in turns, in one process.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from benchmark_scenes import STANDARD, Pair, Scene, plain_seconds, standard_scenes
from effort import DEFAULT, Effort
from findings import Findings, Line, at_least, at_most

from rover_obstacle_detection import Detector, DetectorConfig
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.methods.registry import make_method
from rover_obstacle_detection.evaluation.tables import Table, number, percent
from rover_obstacle_detection.offline.stopwatch import Stopwatch

CLOUDS = 'clouds and obstacles, on request'
MEDIAN_GOAL, WORST_GOAL, LISTING_GOAL = 1.0, 2.0, 50.0


@dataclass(frozen=True)
class PairTimes:
    """The lowest times of all turns of one pair: what other programs take only adds.

    Parameters
    ----------
    seconds, plain_seconds : float
        Of the detector, and of plain SGBM.
    cpu_ratio : float
        CPU time of all threads, relative to that of plain SGBM.
    stages : dict of str to float
        Seconds of each stage in the fastest turn.
    figures : Figures, optional
        What the mask is worth, where there are labels.
    """

    seconds: float
    plain_seconds: float
    cpu_ratio: float
    stages: dict[str, float]
    figures: Figures | None = None

    @property
    def ratio(self) -> float:
        """Time relative to plain SGBM."""
        return self.seconds / self.plain_seconds


class Turn(NamedTuple):
    """Seconds of `detect`, its CPU seconds, and the seconds of each stage and of the clouds."""

    seconds: float
    cpu_seconds: float
    stages: dict[str, float]


def detection_findings(scenes: Sequence[Scene], effort: Effort) -> Findings:
    """Measure all scenes by default, those of 1024 x 768 also at other resolutions."""
    standard = standard_scenes(scenes)
    default = [measured(scene.pair, DEFAULT, effort.turns) for scene in standard]
    others = [
        measured(scene.pair, DEFAULT, effort.turns) for scene in scenes if scene.size != STANDARD
    ]
    by_config = {
        config: default
        if config == DEFAULT
        else [measured(scene.pair, config, effort.turns) for scene in standard]
        for config in effort.configs
    }
    lines = (
        *ratio_lines(default),
        *smaller_lines(others),
        listing_line(standard[: effort.listing_pairs], default),
    )
    return Findings(lines, {'stages': stage_table(default), 'curve': curve_table(by_config)})


def measured(pair: Pair, config: DetectorConfig, turns: int) -> PairTimes:
    """Detect in one pair, in turns with plain SGBM."""
    detector = Detector(pair.camera, config)
    # The first turn is a warm-up.
    found, _ = detected(detector, pair)
    plain, plain_cpu, taken = [], [], []
    for _ in range(turns):
        began = time.process_time()
        plain.append(plain_seconds(pair))
        plain_cpu.append(time.process_time() - began)
        taken.append(detected(detector, pair)[1])
    fastest = min(taken, key=attrgetter('seconds'))
    labelled = isinstance(pair, LabelledFrame)
    return PairTimes(
        fastest.seconds,
        min(plain),
        min(each.cpu_seconds for each in taken) / min(plain_cpu),
        fastest.stages,
        score(found.mask, pair.labels, pair.instances, found.known) if labelled else None,
    )


def detected(detector: Detector, pair: Pair) -> tuple[Detection, Turn]:
    """Detect in a pair, and make the clouds."""
    watch = Stopwatch()
    began, cpu_began = time.perf_counter(), time.process_time()
    found = detector.detect(pair.left, pair.right, on_stage=watch.lap)
    seconds, cpu_seconds = time.perf_counter() - began, time.process_time() - cpu_began
    _ = found.obstacle_points, found.ground_points, found.obstacles
    watch.lap(CLOUDS)
    stages = {stage: ms / 1000 for stage, ms in watch.take_ms().items()}
    return found, Turn(seconds, cpu_seconds, stages)


def ratio_lines(times: Sequence[PairTimes]) -> tuple[Line, ...]:
    """Lines of the time at 1024 x 768 against plain SGBM."""
    ratios = [each.ratio for each in times]
    name = f'detection at {STANDARD[0]} x {STANDARD[1]}'
    return (
        at_most(f'{name}, median of {len(times)} scenes', statistics.median(ratios), MEDIAN_GOAL),
        at_most(f'{name}, worst scene', max(ratios), WORST_GOAL),
        Line(
            f"{name}, median of CPU time relative to SGBM's",
            f'{statistics.median(each.cpu_ratio for each in times):.2f} x',
        ),
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
        seconds = [each.stages.get(stage, 0.0) for each in times]
        ratios = [own / each.plain_seconds for own, each in zip(seconds, times, strict=True)]
        rows.append(
            (stage, f'{statistics.fmean(ratios):.2f}', f'{1000 * statistics.fmean(seconds):.1f}')
        )
    return Table('Stages', ('stage', 'x SGBM', 'ms'), rows)


def curve_table(by_config: dict[DetectorConfig, list[PairTimes]]) -> Table:
    """Tabulate time and accuracy over the resolution."""
    rows = []
    for config, times in by_config.items():
        ratios = [each.ratio for each in times]
        figures = [each.figures for each in times if each.figures is not None]
        ious = [each.iou for each in figures if each.iou is not None]
        total = sum(figures, Figures())
        rows.append(
            (
                setting(config),
                f'{statistics.median(ratios):.2f}',
                f'{max(ratios):.2f}',
                f'{median_ms(each.seconds for each in times):.0f}',
                number(statistics.fmean(ious) if ious else None),
                number(min(ious, default=None)),
                f'{total.obstacles_found}/{total.obstacles}',
                str(total.false_alarms),
                percent(total.called_free_share, 1),
            )
        )
    header = (
        'setting',
        'x SGBM, median',
        'worst',
        'ms',
        'mean IoU',
        'worst IoU',
        'obstacles found',
        'false alarms',
        'obstacle pixels called free',
    )
    return Table('Accuracy over time', header, rows)


def setting(config: DetectorConfig) -> str:
    """Name what decides the resolution."""
    if config.working_scale:
        return f'`working_scale` {config.working_scale:g}'
    default = ' (default)' if config == DEFAULT else ''
    return f'`speed` {config.speed}{default}'
