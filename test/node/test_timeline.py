from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.node.timeline import MIN_ROUND_S, Timeline

START_NS = 1_700_000_000_000_000_000


@pytest.mark.parametrize(('rate', 'due_s'), [(1.0, 1.5), (2.0, 0.75), (0.5, 3.0)])
def test_rate_scales_the_time_a_message_is_due(rate: float, due_s: float) -> None:
    assert Timeline(START_NS, rate).due_s(START_NS + 1_500_000_000) == pytest.approx(due_s)


def test_clock_ticks_evenly_with_recorded_time() -> None:
    timeline = Timeline(START_NS, rate=2.0, clock_hz=10.0)

    ticks_s = [timeline.tick_s(number) for number in range(3)]

    assert ticks_s == pytest.approx([0.0, 0.1, 0.2])
    assert [timeline.recorded_ns(tick_s) - START_NS for tick_s in ticks_s] == [
        0,
        200_000_000,
        400_000_000,
    ]


def test_a_round_of_a_loop_takes_as_long_as_the_recording_but_not_no_time() -> None:
    timeline = Timeline(START_NS, rate=2.0)

    assert timeline.round_s(START_NS + 6_000_000_000) == pytest.approx(3.0)
    for end_ns in (START_NS + 1, START_NS, 0):
        assert timeline.round_s(end_ns) == MIN_ROUND_S == 0.1


def test_no_clock_message_without_a_clock_rate() -> None:
    assert Timeline(START_NS).tick_s(0) == math.inf


@given(rate=st.floats(0.01, 100.0), offset_ns=st.integers(0, 3_600_000_000_000))
def test_due_time_and_recorded_time_are_inverse(rate: float, offset_ns: int) -> None:
    timeline = Timeline(START_NS, rate)

    recorded_ns = timeline.recorded_ns(timeline.due_s(START_NS + offset_ns))

    assert abs(recorded_ns - START_NS - offset_ns) <= 1000
