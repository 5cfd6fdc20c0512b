"""What the live node bears: rate, latency, start-up, memory and its own share of the time.

Node and player are processes of their own, with DDS between them and subscribers to the mask and
both clouds.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import synthetic
from benchmark_scenes import STANDARD, Pair, Scene, plain_seconds, resized, standard_scenes
from effort import Effort
from findings import Findings, Line, at_most
from live_graph import LiveGraph, Process, live_graph, write_pairs
from live_load import Overload, Steady, first_mask_s, idle_cpu_share, overload, steady

T = TypeVar('T')

HOLLOW = Path(__file__).with_name('hollow_node.py')
VGA = (640, 480)
GOAL_HZ, VGA_GOAL_HZ = 10.0, 25.0
# Of the rate of detections, where pairs are dropped.
SHARES = (1.0, 0.85, 0.7, 0.5, 0.35)
P50_GOAL_MS, P95_GOAL_MS = 100.0, 150.0
OVERHEAD_GOAL = 0.15
MEMORY_GOAL_MB, GROWTH_GOAL = 300.0, 0.05
FIRST_MASK_GOAL_S = 2.0
IDLE_GOAL = 0.03
IDLE_HZ, OVERLOAD_HZ = 10.0, 60.0
# A recording of three seconds is played in a loop.
LOOP_S = 3.0
# Pairs that settle the node in a short run.
FEW = 10
SECOND = 1_000_000_000


@dataclass(frozen=True)
class Run:
    """One steady run at one rate."""

    rate_hz: float
    figures: Steady

    @property
    def reached_hz(self) -> float:
        """Detections per second."""
        return self.rate_hz * self.figures.detections / max(self.figures.pairs, 1)

    @property
    def misses(self) -> int:
        """Pairs dropped and images lost after the node settled."""
        figures = self.figures
        dropped = figures.dropped - figures.settled_dropped
        return dropped + figures.lost - figures.settled_lost


def live_findings(scenes: Sequence[Scene], effort: Effort) -> Findings:
    """Run the node under all loads."""
    if importlib.util.find_spec('rclpy') is None:
        return Findings((Line('live', 'not measured: needs ROS 2'),))
    rock = synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25)
    view = synthetic.render(synthetic.mast(*STANDARD, solids=(rock,)))
    pairs = [scene.pair for scene in standard_scenes(scenes)]
    full = of_one_camera(pairs)
    small = [resized(pair, *VGA) for pair in full]
    plain_ms = 1000 * min(plain_seconds(full[0]) for _ in range(effort.turns + 1))

    settled = effort.settled_pairs
    long_run = at_rate(full, GOAL_HZ, effort.live_pairs, settled)
    vga_run = at_rate(small, VGA_GOAL_HZ, effort.rate_pairs, settled)
    hollow = at_rate(full, GOAL_HZ / 2, effort.rate_pairs, settled, start_hollow)
    first_s = on_graph(lambda graph: first_mask_s(graph, view))
    idle = on_graph(
        lambda graph: idle_cpu_share(graph, view, rate_hz=IDLE_HZ, seconds=effort.idle_s)
    )
    flood = on_graph(
        lambda graph: overload(graph, view, rate_hz=OVERLOAD_HZ, seconds=effort.overload_s)
    )
    return Findings(
        (
            *rate_lines(long_run, STANDARD, lambda hz: for_a_while(full, hz, effort.search_s)),
            *latency_lines(long_run),
            *rate_lines(vga_run, VGA, lambda hz: for_a_while(small, hz, effort.search_s)),
            *overhead_lines(hollow, plain_ms),
            *memory_lines(long_run),
            at_most(
                'first mask after the start of the process', first_s, FIRST_MASK_GOAL_S, '{:.1f} s'
            ),
            at_most(
                f'{IDLE_HZ:g} Hz without subscribers, share of a core', idle, IDLE_GOAL, '{:.1%}'
            ),
            overload_line(flood),
        )
    )


def of_one_camera(pairs: Sequence[Pair]) -> list[Pair]:
    """Return the pairs that the camera of the first one could have taken."""
    first = pairs[0]
    return [
        pair
        for pair in pairs
        if pair.camera == first.camera and pair.left.shape == first.left.shape
    ]


def on_graph(work: Callable[[LiveGraph], T]) -> T:
    """Do something in a ROS graph of its own."""
    with tempfile.TemporaryDirectory() as folder, live_graph(Path(folder)) as graph:
        return work(graph)


def start_hollow(graph: LiveGraph) -> Process:
    """Start the node with a detector that takes no time."""
    process = graph.start_python('hollow', str(HOLLOW), '-r', '__ns:=/stereo')
    return graph.wait_until_active(process)


def at_rate(
    pairs: Sequence[Pair],
    rate_hz: float,
    count: int,
    settled_pairs: int,
    start_node: Callable[[LiveGraph], Process] = LiveGraph.start_node,
) -> Run:
    """Play pairs in turn; measure the node during `count` of them, once it has settled."""
    images = [(pair.left, pair.right) for pair in pairs]
    # A camera that repeats its image counts as frozen.
    images += [(left ^ 1, right ^ 1) for left, right in images]
    period_ns = round(SECOND / rate_hz)
    recorded = max(round(LOOP_S * rate_hz), len(images))
    stamps = [1000 * SECOND + n * period_ns for n in range(recorded)]
    end = stamps[-1] + period_ns
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'bag'
        write_pairs(bag, pairs[0].camera, images, stamps, end=end, compress=False)
        figures = on_graph(
            lambda graph: steady(
                graph, bag, count, settled_pairs, loop=True, start_node=start_node
            )
        )
    print(f'  {rate_hz:g} Hz: {figures}', file=sys.stderr)
    return Run(rate_hz, figures)


def for_a_while(pairs: Sequence[Pair], rate_hz: float, seconds: float) -> Run:
    """Play pairs in turn at a rate for some seconds after the first ones."""
    return at_rate(pairs, rate_hz, round(seconds * rate_hz), FEW)


def rate_lines(run: Run, size: tuple[int, int], again: Callable[[float], Run]) -> tuple[Line, ...]:
    """Line of the goal rate, and of the highest rate without drops if there were some."""
    figures = run.figures
    name = f'live, {size[0]} x {size[1]}'
    line = Line(
        f'{name} at {run.rate_hz:g} Hz',
        f'{figures.pairs} pairs, {figures.dropped - figures.settled_dropped} dropped, '
        f'{figures.lost - figures.settled_lost} images lost{latency_text(run)}',
        f'{run.rate_hz:g} Hz without drops',
        not run.misses,
    )
    if not run.misses:
        return (line,)
    highest = highest_rate(run, again)
    found = 'none' if highest is None else f'{highest.rate_hz:g} Hz{latency_text(highest)}'
    return line, Line(f'{name}, highest rate without drops', found)


def highest_rate(run: Run, again: Callable[[float], Run]) -> Run | None:
    """Return the first run without drops at ever lower rates, from what `run` detected."""
    for share in SHARES:
        lower = again(max(round(run.reached_hz * share, 1), 0.1))
        if not lower.misses:
            return lower
    return None


def latency_text(run: Run) -> str:
    figures = run.figures
    return f', latency p50 {figures.latency_p50_ms:.0f} ms, p95 {figures.latency_p95_ms:.0f} ms'


def latency_lines(run: Run) -> tuple[Line, ...]:
    """Lines of the time from the second image to the last message."""
    name = f'latency at {STANDARD[0]} x {STANDARD[1]}, {run.rate_hz:g} Hz'
    return (
        at_most(f'{name}, p50', run.figures.latency_p50_ms, P50_GOAL_MS, '{:.0f} ms'),
        at_most(f'{name}, p95', run.figures.latency_p95_ms, P95_GOAL_MS, '{:.0f} ms'),
    )


def overhead_lines(hollow: Run, plain_ms: float) -> tuple[Line, ...]:
    """Lines of what the node takes besides the detection."""
    what = 'node without detection'
    return (
        at_most(
            f'{what}, latency p50 (decoding, messages, publishing)',
            hollow.figures.latency_p50_ms / plain_ms,
            OVERHEAD_GOAL,
        ),
        at_most(
            f'{what}, CPU time per pair (also reception and diagnostics)',
            hollow.figures.cpu_ms / plain_ms,
            OVERHEAD_GOAL,
        ),
    )


def memory_lines(run: Run) -> tuple[Line, ...]:
    """Lines of resident memory at the end, and of its growth since the node settled."""
    figures = run.figures
    growth = figures.end_mb / figures.settled_mb - 1
    return (
        at_most(
            f'memory of the node after {figures.pairs} pairs',
            figures.end_mb,
            MEMORY_GOAL_MB,
            '{:.0f} MB',
        ),
        Line('of it not shared with the other processes', f'{figures.own_mb:.0f} MB'),
        at_most('growth of memory since it settled', growth, GROWTH_GOAL, '{:.1%}'),
    )


def overload_line(flood: Overload) -> Line:
    """Line of the age of what the node detects when it cannot keep up."""
    median_ms, late_ms = np.percentile(flood.staleness_s, (50, 95)) * 1000
    counted = flood.received + flood.lost == 2 * flood.sent
    counted &= flood.detections + flood.dropped == flood.pairs
    return Line(
        f'age of a pair when its detection starts, {OVERLOAD_HZ:g} Hz',
        f'p50 {median_ms:.0f} ms, p95 {late_ms:.0f} ms; {flood.dropped} of {flood.pairs} dropped',
        'every lost or dropped pair is counted',
        counted,
    )
