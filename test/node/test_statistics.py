from __future__ import annotations

import pytest

from rover_obstacle_detection.node.statistics import NodeStatistics


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_counts_are_zero_and_times_unknown_at_first() -> None:
    snapshot = NodeStatistics().snapshot()

    assert (snapshot.pair_rate_hz, snapshot.detected, snapshot.dropped, snapshot.lost) == (0,) * 4
    assert snapshot.bad_frames == 0
    assert snapshot.latency_p50_ms is None
    assert snapshot.valid_share is None
    assert snapshot.rows_off_px is None


def test_rate_of_a_steady_stream_and_of_one_that_stopped() -> None:
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


def test_latency_percentiles_of_the_latest_detections() -> None:
    statistics = NodeStatistics()
    for _ in range(200):
        statistics.detection(9.0, 0.1, 0.0)
    for number in range(100):
        statistics.detection(number / 1000, 0.9, 0.05, 0.6, 0.2)

    snapshot = statistics.snapshot()

    assert snapshot.detected == 300
    assert snapshot.latency_p50_ms == pytest.approx(49.5)
    assert snapshot.latency_p95_ms == pytest.approx(94.05)
    assert (snapshot.valid_share, snapshot.obstacle_share) == (0.9, 0.05)
    assert (snapshot.rows_off_px, snapshot.lens_bend_px) == (0.6, 0.2)


def test_bad_frames_by_reason() -> None:
    statistics = NodeStatistics()
    for reason in ('ImageError', 'ImageError', 'no calibration'):
        statistics.bad_frame(reason)
    statistics.drop()
    statistics.lost(3)

    snapshot = statistics.snapshot()

    assert snapshot.bad == {'ImageError': 2, 'no calibration': 1}
    assert (snapshot.bad_frames, snapshot.dropped, snapshot.lost) == (3, 1, 3)
