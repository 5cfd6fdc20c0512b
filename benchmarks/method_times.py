"""Measure the run time of methods relative to plain SGBM.

    python benchmarks/method_times.py bags/mars_yard --method hybrid --method study

Plain SGBM is 3WAY, 64 disparities, block 5, P1 300, P2 1200, uniqueness 8, speckle 50. SGBM and
the methods take turns on each pair, so background load affects all equally. The first turn is a
warm-up. The table shows median times and the median ratio to the SGBM call of the same turn.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path

import cv2
from benchmark_scenes import Pair, plain_seconds, read_scenes

from rover_obstacle_detection.evaluation.methods.method import Method
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.methods.registry import make_method


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG')
    parser.add_argument('--method', action='append', choices=METHOD_DESCRIPTIONS, dest='methods')
    parser.add_argument('--repeat', type=int, default=11, help='turns per pair (default: 11)')
    parser.add_argument('--every', type=int, default=1, help='only every N-th pair (default: 1)')
    arguments = parser.parse_args()
    methods = {name: make_method(name) for name in arguments.methods or ['hybrid']}
    print(f'OpenCV {cv2.__version__}, {cv2.getNumThreads()} threads')
    print(f'{"pair":28} {"size":>10} {"method":11} {"ms":>7} {"SGBM ms":>8} {"x SGBM":>7}')
    ratios: dict[str, list[float]] = {name: [] for name in methods}
    for scene in read_scenes(arguments.bags)[:: arguments.every]:
        rows = time_pair(methods, scene.pair, arguments.repeat)
        for name, (seconds, plain, ratio) in rows.items():
            ratios[name].append(ratio)
            size = f'{scene.size[0]}x{scene.size[1]}'
            print(
                f'{scene.name:28} {size:>10} {name:11} {1000 * seconds:7.1f} '
                f'{1000 * plain:8.1f} {ratio:7.2f}',
                flush=True,
            )
    for name, values in ratios.items():
        print(f'{name}: mean {statistics.fmean(values):.2f}, worst {max(values):.2f} x SGBM')


def time_pair(
    methods: dict[str, Method], pair: Pair, repeat: int
) -> dict[str, tuple[float, float, float]]:
    """Median seconds, median SGBM seconds and median ratio of each method."""
    seconds: dict[str, list[float]] = {name: [] for name in methods}
    plain: dict[str, list[float]] = {name: [] for name in methods}
    for turn in range(repeat + 1):
        for name, method in methods.items():
            yardstick = plain_seconds(pair)
            started = time.perf_counter()
            method(pair.camera, pair.left, pair.right)
            own_seconds = time.perf_counter() - started
            if turn:
                plain[name].append(yardstick)
                seconds[name].append(own_seconds)
    return {
        name: (
            statistics.median(seconds[name]),
            statistics.median(plain[name]),
            statistics.median(
                own / other for own, other in zip(seconds[name], plain[name], strict=True)
            ),
        )
        for name in methods
    }


if __name__ == '__main__':
    main()
