"""Measure what the hybrid method takes, stage by stage and at several resolutions.

    python benchmarks/detection_times.py bags/*
    python benchmarks/detection_times.py LABELLED_BAG... --scales 0 0.5 0.75 1

Times are relative to one plain SGBM call (3WAY, 64 disparities, block 5, P1 300, P2 1200,
uniqueness 8, speckle 50) on the full-size pair, just before. The first turn is a warm-up. Where
bags have labels, each scale also shows what its masks are worth. Scale 0 is the detector's choice.
Run it on an otherwise idle machine.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2

from rover_obstacle_detection import Detector, DetectorConfig
from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import StereoPair, read_pairs
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.plain_stereo import plain_stereo_seconds
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics

CLOUDS = 'clouds and obstacles, on request'
Pair = StereoPair | LabelledFrame


@dataclass
class Times:
    """Ratios to plain SGBM: of `detect` for each pair, and of each stage; scores of the masks."""

    detect: list[float] = field(default_factory=list)
    stages: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    scores: list[Figures] = field(default_factory=list)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG')
    parser.add_argument('--scales', nargs='+', type=float, default=[0.0])
    parser.add_argument('--repeat', type=int, default=7, help='turns per pair (default: 7)')
    arguments = parser.parse_args()
    print(f'OpenCV {cv2.__version__}, {cv2.getNumThreads()} threads')
    by_scale = {scale: Times() for scale in arguments.scales}
    for path in arguments.bags:
        for number, pair in enumerate(pairs_of(path)):
            for scale, times in by_scale.items():
                measure(pair, scale, times, arguments.repeat)
            ratios = ', '.join(f'{times.detect[-1]:.2f}' for times in by_scale.values())
            print(f'{path.resolve().name} {number}: {ratios} x SGBM', flush=True)
    print_scales(by_scale)
    print_stages(by_scale[arguments.scales[0]])


def pairs_of(path: Path) -> Iterator[Pair]:
    """Labelled frames of a bag, or its pairs where it has no labels."""
    with open_bag(path) as bag:
        try:
            frames, _ = labelled_frames(bag, find_truth_topics(bag), BagOptions())
        except BagError:
            frames = read_pairs(bag, bag.stereo_topics())
        yield from (each for each in frames if isinstance(each, StereoPair | LabelledFrame))


def measure(pair: Pair, scale: float, times: Times, repeat: int) -> None:
    """Detect in one pair at one scale, in turns with plain SGBM."""
    detector = Detector(pair.camera, DetectorConfig(working_scale=scale))
    ratios: list[float] = []
    stages: dict[str, list[float]] = defaultdict(list)
    for turn in range(repeat + 1):
        plain = plain_stereo_seconds(pair.camera, pair.left, pair.right)
        ends: list[tuple[str, float]] = []
        began = time.perf_counter()
        found = detector.detect(
            pair.left,
            pair.right,
            on_stage=lambda stage, ends=ends: ends.append((stage, time.perf_counter())),
        )
        ratio = (time.perf_counter() - began) / plain
        on_request = requested_seconds(found) / plain
        if turn:
            ratios.append(ratio)
            stages[CLOUDS].append(on_request)
            for (stage, end), start in zip(ends, [began, *(end for _, end in ends)], strict=False):
                stages[stage].append((end - start) / plain)
    times.detect.append(statistics.median(ratios))
    for stage, values in stages.items():
        times.stages[stage].append(statistics.median(values))
    if isinstance(pair, LabelledFrame):
        times.scores.append(score(found.mask, pair.labels, pair.instances, found.known))


def requested_seconds(found: Detection) -> float:
    """Time of what is computed on first access."""
    began = time.perf_counter()
    _ = found.obstacle_points, found.ground_points, found.obstacles
    return time.perf_counter() - began


def print_scales(by_scale: dict[float, Times]) -> None:
    print(f'\n{"scale":>5} {"median":>7} {"worst":>6}   x SGBM')
    for scale, times in by_scale.items():
        line = f'{scale:5g} {statistics.median(times.detect):7.2f} {max(times.detect):6.2f}'
        ious = [each.iou for each in times.scores if each.iou is not None]
        if ious:
            total = sum(times.scores, Figures())
            line += (
                f'   mean IoU {statistics.fmean(ious):.3f}, worst {min(ious):.3f}, '
                f'{total.obstacles_found} of {total.obstacles} obstacles, '
                f'{total.false_alarms} false alarms'
            )
        print(line)


def print_stages(times: Times) -> None:
    print('\nmean x SGBM of each stage')
    for stage, values in times.stages.items():
        print(f'  {stage:34} {statistics.fmean(values):5.2f}')


if __name__ == '__main__':
    main()
