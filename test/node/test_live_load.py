"""The node's load: idle, steady and overloaded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import live_graph, write_stereo_bag
from live_load import idle_cpu_share, overload, steady

FULL = synthetic.mast(1024, 768, solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),))
MIDDLE, SMALL = synthetic.mast(640, 480), synthetic.mast()
SECOND = 1_000_000_000


def test_idle_node_takes_less_than_3_percent_of_a_core(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        assert idle_cpu_share(graph, synthetic.render(FULL), rate_hz=10.0, seconds=4.0) < 0.03


def test_overloaded_node_detects_the_newest_pair_and_counts_the_others(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        figures = overload(graph, synthetic.render(MIDDLE), rate_hz=60.0, seconds=4.0)

    assert len(figures.staleness_s) >= 2
    assert np.median(figures.staleness_s) < 2 * figures.frame_s
    assert figures.dropped > 0
    assert figures.bad == 0
    # Every lost image is counted.
    assert figures.pairs == figures.detections + figures.dropped
    assert figures.received + figures.lost == 2 * figures.sent


def test_no_large_pair_is_lost_at_5_hz(tmp_path: Path) -> None:
    frames = 20
    write_stereo_bag(tmp_path / 'bag', synthetic.render(FULL), stamps_ns(frames, rate_hz=5))

    with live_graph(tmp_path) as graph:
        figures = steady(graph, tmp_path / 'bag', frames, settled_after=10)

    assert (figures.pairs, figures.lost) == (frames, 0)
    assert figures.detections + figures.dropped == frames
    # Typically 275 to 295 MB at this image size.
    assert figures.end_mb < 340


def test_memory_is_constant_after_50_pairs(tmp_path: Path) -> None:
    frames = 100
    write_stereo_bag(tmp_path / 'bag', synthetic.render(SMALL), stamps_ns(frames, rate_hz=20))

    with live_graph(tmp_path) as graph:
        figures = steady(graph, tmp_path / 'bag', frames, settled_after=50)

    assert (figures.pairs, figures.lost) == (frames, 0)
    assert figures.end_mb < 1.05 * figures.settled_mb


def stamps_ns(count: int, rate_hz: int) -> list[int]:
    return [1000 * SECOND + number * SECOND // rate_hz for number in range(count)]
