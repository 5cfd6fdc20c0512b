from __future__ import annotations

import pytest

from rover_obstacle_detection.node.load import Load
from rover_obstacle_detection.node.statistics import DetectionFigures, NodeStatistics, Recent


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
    statistics.image(lost=3)

    snapshot = statistics.snapshot()

    assert snapshot.bad == {'ImageError': 2, 'no calibration': 1}
    assert (snapshot.bad_frames, snapshot.dropped, snapshot.lost) == (3, 1, 3)


def test_recent_pairs_are_judged_or_failed() -> None:
    clock = Clock()
    statistics = NodeStatistics(clock)
    assert statistics.snapshot().recent == Recent()
    for event in (
        lambda: statistics.detection(0.1, DetectionFigures(), ('blurred',)),
        lambda: statistics.bad_frame('stamp is zero'),
        lambda: statistics.bad_frame('unjudgeable pair', 'lens covered'),
        lambda: statistics.withheld('frozen'),
        lambda: statistics.detection(0.1, DetectionFigures()),
    ):
        clock.now_s += 0.2
        event()

    snapshot = statistics.snapshot()

    assert snapshot.recent == Recent(judged=2, failed=2, problem='frozen', warnings=('blurred',))
    assert snapshot.warned == 1
    assert snapshot.bad == {'stamp is zero': 1, 'unjudgeable pair': 1, 'frozen image': 1}


def test_latest_pair_counts_until_the_next_one() -> None:
    clock = Clock()
    statistics = NodeStatistics(clock)
    statistics.detection(0.1, DetectionFigures())
    statistics.bad_frame('unjudgeable pair', 'lens covered')

    clock.now_s += 60.0

    assert statistics.snapshot().recent == Recent(failed=1, problem='lens covered')
    statistics.forget_outcomes()
    assert statistics.snapshot().recent == Recent()
    assert statistics.snapshot().failing_s == 0.0


def test_time_without_a_judged_pair() -> None:
    clock = Clock()
    statistics = NodeStatistics(clock)
    for event in (
        lambda: statistics.bad_frame('ImageError', 'lens covered'),
        lambda: statistics.withheld('frozen'),
        lambda: statistics.bad_frame('ImageError', 'lens still covered'),
    ):
        clock.now_s += 1.0
        event()

    assert statistics.snapshot().failing_s == 2.0
    statistics.detection(0.1, DetectionFigures())
    # What is withheld for a frozen image is a fault of its own.
    statistics.withheld('frozen')
    clock.now_s += 1.0
    assert statistics.snapshot().failing_s == 0.0


def test_load_covers_the_last_ten_seconds() -> None:
    clock = Clock()
    statistics = NodeStatistics(clock)
    for second in range(30):
        clock.now_s += 1.0
        statistics.image(lost=1 if second < 25 else 0)
        statistics.pair()
        statistics.detection(1.0 if second < 5 else 0.2, DetectionFigures())
    statistics.drop()

    assert statistics.snapshot().load == Load(
        seconds=10.0, images=11, lost=6, pairs=11, dropped=1, ended=11,
        latency_p95_s=pytest.approx(0.2),
    )  # fmt: skip
    clock.now_s += 60.0
    assert statistics.snapshot().load == Load()


def test_load_starts_again_after_an_idle_time() -> None:
    statistics = NodeStatistics(Clock())
    statistics.image(lost=9)
    statistics.detection(3.0, DetectionFigures())

    statistics.forget_outcomes()

    assert statistics.snapshot().load == Load()
