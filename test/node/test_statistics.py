from __future__ import annotations

import pytest

from rover_obstacle_detection.node.statistics import DetectionFigures, NodeStatistics


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_initial_snapshot() -> None:
    snapshot = NodeStatistics().snapshot()

    assert (snapshot.pair_rate_hz, snapshot.detected, snapshot.dropped, snapshot.lost) == (0,) * 4
    assert snapshot.bad_frames == 0
    assert snapshot.latency_p50_ms is None
    assert snapshot.latest == DetectionFigures()


def test_rate_of_a_steady_and_of_a_stopped_stream() -> None:
    clock = Clock()
    statistics = NodeStatistics(clock)
    for _ in range(40):
        clock.now_s += 0.2
        statistics.pair()

    assert statistics.snapshot().pair_rate_hz == pytest.approx(5.0)
    clock.now_s += 2.0
    assert statistics.snapshot().pair_rate_hz == pytest.approx(0.5)
    clock.now_s += 10.0
    assert statistics.snapshot().pair_rate_hz == 0.0


def test_latency_percentiles_cover_the_latest_100_detections() -> None:
    statistics = NodeStatistics()
    figures = DetectionFigures(0.9, 0.05, 0.6, 0.2)
    for _ in range(200):
        statistics.detection(9.0, DetectionFigures())
    for number in range(100):
        statistics.detection(number / 1000, figures)

    snapshot = statistics.snapshot()

    assert snapshot.detected == 300
    assert snapshot.latency_p50_ms == pytest.approx(49.5)
    assert snapshot.latency_p95_ms == pytest.approx(94.05)
    assert snapshot.latest == figures


def test_bad_frames_are_counted_by_reason() -> None:
    statistics = NodeStatistics()
    for reason in ('ImageError', 'ImageError', 'no calibration'):
        statistics.bad_frame(reason)
    statistics.drop()
    statistics.lost(3)

    snapshot = statistics.snapshot()

    assert snapshot.bad == {'ImageError': 2, 'no calibration': 1}
    assert (snapshot.bad_frames, snapshot.dropped, snapshot.lost) == (3, 1, 3)
