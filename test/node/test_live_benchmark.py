"""The live part of the benchmark, by figures that are known, and the node without detection."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import live_graph, write_stereo_bag
from live_load import Overload, Steady, steady
from live_node import (
    Run,
    highest_rate,
    latency_lines,
    memory_lines,
    overhead_lines,
    overload_line,
    rate_lines,
    start_hollow,
)

GOOD = Steady(
    sent=100,
    pairs=110,
    lost=2,
    dropped=3,
    detections=107,
    latency_p50_ms=60.0,
    latency_p95_ms=160.0,
    settled_mb=200.0,
    end_mb=208.0,
    own_mb=80.0,
    settled_lost=2,
    settled_dropped=3,
    cpu_ms=6.0,
)


def never(rate_hz: float) -> Run:
    raise AssertionError(rate_hz)


def test_what_is_dropped_before_the_node_settled_does_not_count() -> None:
    (line,) = rate_lines(Run(10.0, GOOD), (1024, 768), never)
    assert line.met is True
    assert line.measured == ('110 pairs, 0 dropped, 0 images lost, latency p50 60 ms, p95 160 ms')


def test_highest_rate_is_searched_below_what_was_reached() -> None:
    tried = []

    def again(rate_hz: float) -> Run:
        tried.append(rate_hz)
        return Run(rate_hz, replace(GOOD, dropped=3 + (rate_hz > 4.0)))

    bad = Run(10.0, replace(GOOD, detections=60, dropped=50))
    missed, highest = rate_lines(bad, (640, 480), again)
    assert missed.met is False
    assert '47 dropped' in missed.measured
    assert highest.measured == '3.8 Hz, latency p50 60 ms, p95 160 ms'
    assert tried == [5.5, 4.6, 3.8]
    assert highest_rate(bad, lambda rate_hz: replace(bad, rate_hz=rate_hz)) is None


def test_lines_of_latency_memory_and_overhead() -> None:
    run = Run(10.0, GOOD)
    assert [(line.measured, line.met) for line in latency_lines(run)] == [
        ('60 ms', True),
        ('160 ms', False),
    ]
    assert [(line.measured, line.met) for line in memory_lines(run)] == [
        ('208 MB', True),
        ('80 MB', None),
        ('4.0%', True),
    ]
    assert [(line.measured, line.met) for line in overhead_lines(run, plain_ms=50.0)] == [
        ('1.20 x SGBM', False),
        ('0.12 x SGBM', True),
    ]


def test_overloaded_node_has_to_count_what_it_drops() -> None:
    flood = Overload(
        frame_s=0.1,
        sent=20,
        received=38,
        pairs=19,
        lost=2,
        dropped=15,
        detections=4,
        bad=0,
        staleness_s=np.array([0.01, 0.02, 0.03]),
        recovered_s=0.1,
    )
    line = overload_line(flood)
    assert (line.measured, line.met) == ('p50 20 ms, p95 29 ms; 15 of 19 dropped', True)
    assert overload_line(replace(flood, lost=1)).met is False
    assert overload_line(replace(flood, dropped=14)).met is False


def test_node_without_detection_publishes_its_first_result_again(tmp_path: Path) -> None:
    view = synthetic.render(synthetic.mast())
    second = 1_000_000_000
    stamps = [1000 * second + n * second // 10 for n in range(10)]
    write_stereo_bag(tmp_path / 'bag', view, stamps, end=1001 * second)

    with live_graph(tmp_path) as graph:
        masks = graph.subscribe('sensor_msgs/msg/Image', '/stereo/obstacle_mask')
        figures = steady(graph, tmp_path / 'bag', 10, 5, loop=True, start_node=start_hollow)

    assert figures.pairs >= 15
    assert figures.detections + figures.dropped == figures.pairs
    assert len(masks.messages) == figures.detections
    assert len({bytes(message.data) for message in masks.messages}) == 1
    assert figures.cpu_ms > 0
