"""Measure the live node: start-up, idle load, steady input and overload.

Node and player run as separate processes over DDS, with 1024 x 768 images and subscribers to the
mask and both clouds. Takes about two minutes; run it on an otherwise idle machine.

    python benchmarks/live_node.py
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / 'test' / 'support'))

import synthetic
from live_graph import LiveGraph, live_graph, write_stereo_bag
from live_load import first_mask_s, idle_cpu_share, overload, steady

FRAMES = 200
RATE_HZ = 5
# Pairs after which memory should no longer grow.
SETTLED_AFTER = 50
SECOND = 1_000_000_000


def main() -> None:
    rock = synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25)
    view = synthetic.render(synthetic.mast(1024, 768, solids=(rock,)))

    seconds = _measure(lambda graph: first_mask_s(graph, view))
    print(f'first mask: {seconds:.1f} s after the start of the process')

    share = _measure(lambda graph: idle_cpu_share(graph, view, rate_hz=10.0, seconds=20.0))
    print(f'10 Hz without subscribers: {share:.1%} of a core')

    period_ns = SECOND // RATE_HZ
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'bag'
        write_stereo_bag(bag, view, [1000 * SECOND + n * period_ns for n in range(FRAMES)])
        figures = _measure(lambda graph: steady(graph, bag, FRAMES, SETTLED_AFTER))
    print(
        f'{FRAMES} pairs at {RATE_HZ} Hz: {figures.pairs} received, {figures.lost} images lost, '
        f'{figures.detections} detected, {figures.dropped} dropped; latency '
        f'p50 {figures.latency_p50_ms:.0f} ms, p95 {figures.latency_p95_ms:.0f} ms; memory '
        f'{figures.settled_mb:.0f} MB after {SETTLED_AFTER} pairs, {figures.end_mb:.0f} MB at the '
        f'end, {figures.own_mb:.0f} MB of it not shared'
    )

    flood = _measure(lambda graph: overload(graph, view, rate_hz=60.0, seconds=10.0))
    p50, p95 = np.percentile(flood.staleness_s, (50, 95)) * 1000
    print(
        f'{flood.sent} pairs at 60 Hz: {flood.pairs} received, {flood.lost} images lost, '
        f'{flood.detections} detected, {flood.dropped} dropped; age of a pair when its detection '
        f'starts p50 {p50:.0f} ms, p95 {p95:.0f} ms; next pair after the overload detected '
        f'in {flood.recovered_s * 1000:.0f} ms'
    )


def _measure(work: Callable[[LiveGraph], Any]) -> Any:
    with tempfile.TemporaryDirectory() as folder, live_graph(Path(folder)) as graph:
        return work(graph)


if __name__ == '__main__':
    main()
