"""The watchdog on a fake clock."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rover_obstacle_detection.node.statistics import NodeStatistics, Snapshot
from rover_obstacle_detection.node.watchdog import Faults, Watchdog, WatchdogLimits

LIMITS = WatchdogLimits(frozen_after=10, stale_after_s=2.0, max_image_age_s=2.0)
NOTHING = NodeStatistics().snapshot()
START_S = 1000.0


class Stream:
    """Pairs at 10 Hz into a watchdog, and what it says."""

    def __init__(self, limits: WatchdogLimits | None = LIMITS) -> None:
        self.faults: list[str] = []
        self.recoveries: list[str] = []
        self.watchdog = Watchdog(limits, self.faults.append, self.recoveries.append)
        self.now_s = START_S
        self.stamp_offset_s = 0.0
        self.watchdog.start(self.now_s)
        self._random = np.random.default_rng(0)

    def image(self) -> bytes:
        return self._random.integers(0, 256, 1000, np.uint8).tobytes()

    def send(self, count: int, left: bytes = b'', stamp_s: float | None = None) -> str:
        """Send pairs; with `left` or `stamp_s`, that image or stamp every time."""
        text = ''
        for _ in range(count):
            self.now_s += 0.1
            taken_s = self.now_s + self.stamp_offset_s if stamp_s is None else stamp_s
            images = left or self.image(), self.image()
            age_s = self.now_s - taken_s
            for side in (0, 1):
                self.watchdog.image(side, self.now_s)
            text = self.watchdog.take(images, round(taken_s * 1e9), self.now_s, age_s)
        return text

    def wait(self, seconds: int) -> None:
        for _ in range(seconds):
            self.now_s += 1.0
            self.check()

    def check(self, counts: Snapshot = NOTHING) -> Faults:
        return self.watchdog.check(self.now_s, counts)


def failing(seconds: float) -> Snapshot:
    recent = dataclasses.replace(NOTHING.recent, failed=5, problem='lens covered')
    return dataclasses.replace(NOTHING, failing_s=seconds, recent=recent)


def test_good_stream_has_no_faults() -> None:
    stream = Stream()

    for _ in range(5):
        assert stream.send(10) == ''
        assert stream.check() == Faults()

    assert stream.faults == stream.recoveries == []
    assert stream.watchdog.image_age_s == pytest.approx(0)


def test_frozen_camera_is_reported_and_its_recovery_once() -> None:
    stream, image = Stream(), bytes(range(200))
    stream.send(5)
    assert stream.send(10, left=image) == ''

    text = stream.send(3, left=image)

    assert text.startswith('left image has not changed for 12 frames (1.2 s)')
    assert stream.check() == Faults(input=text)
    assert stream.faults[-1] == text
    assert stream.send(3) == ''
    assert stream.check() == Faults()
    assert stream.recoveries == ['images change again']


def test_silence_is_reported_until_pairs_arrive() -> None:
    stream = Stream()
    stream.send(5)

    stream.wait(2)
    assert stream.check() == Faults()
    stream.wait(1)

    assert stream.check() == Faults(input='no images on left and right for 3.0 s')
    stream.send(1)
    assert stream.check() == Faults()
    assert stream.recoveries == ['pairs arrive again']


def test_silence_from_the_start_is_reported() -> None:
    stream = Stream()

    stream.wait(3)

    assert stream.check().input == 'no images on left and right for 3.0 s'


def test_silent_camera_is_named_and_images_without_pairs_are_not_silence() -> None:
    stream = Stream()
    stream.send(5)
    for _ in range(3):
        stream.now_s += 1.0
        stream.watchdog.image(1, stream.now_s)

    topics = ('/left (no publisher)', '/right (published by /camera)')
    silent = stream.watchdog.check(stream.now_s, NOTHING, topics)
    stream.watchdog.image(0, stream.now_s)
    unmatched = stream.watchdog.check(stream.now_s, NOTHING, topics)

    assert silent.input == 'no images on /left (no publisher) for 3.0 s'
    assert unmatched.input == 'no pair for 3.0 s'


def test_camera_that_repeats_its_stamp_is_reported() -> None:
    stream = Stream()
    stamp_s = stream.now_s
    stream.send(10, stamp_s=stamp_s)
    assert stream.check() == Faults()

    assert stream.send(3, stamp_s=stamp_s) == ''

    assert stream.check().input.startswith(
        'header.stamp of both images has not changed for 12 pairs: expected the time of exposure'
    )
    stream.send(1)
    assert stream.check() == Faults()
    assert stream.recoveries == ['stamps change again']


def test_paused_simulation_is_not_silence() -> None:
    stream = Stream()
    stream.send(5)

    assert {stream.check() for _ in range(100)} == {Faults()}


@pytest.mark.parametrize('jump_s', [-900.0, 1.6e9])
def test_jump_of_simulated_time_is_not_silence(jump_s: float) -> None:
    stream = Stream(dataclasses.replace(LIMITS, stale_after_s=6.0))
    stream.send(5)
    stream.now_s += jump_s

    assert stream.check() == Faults()


def test_nothing_is_expected_of_an_idle_node() -> None:
    stream = Stream()
    stream.wait(3)
    stream.watchdog.stop()

    stream.wait(3)

    assert stream.check(failing(9.0)) == Faults()
    assert stream.recoveries == []


def test_images_that_arrive_late_are_reported() -> None:
    stream = Stream()
    stream.send(5)
    stream.stamp_offset_s = -4.2
    stream.send(60)

    assert stream.check().input.startswith('stamps are 4.2 s behind the clock of this node')
    # Later than any recording that begins: the clock is known to be the node's.
    stream.now_s += 100.0
    stream.stamp_offset_s = -104.2
    stream.send(1)
    assert stream.check().input.startswith('stamps are 104.2 s behind')
    stream.stamp_offset_s = 0.0
    stream.send(1)
    assert stream.check() == Faults()
    assert stream.recoveries == ['images arrive in time again']


@pytest.mark.parametrize('offset_s', [-900.0, 30.0])
def test_stamps_of_another_clock_are_not_judged(offset_s: float) -> None:
    stream = Stream()
    stream.stamp_offset_s = offset_s

    stream.send(20)

    assert stream.check() == Faults()
    assert stream.watchdog.image_age_s is None


def test_recording_after_a_live_camera_is_of_another_clock() -> None:
    stream = Stream()
    stream.send(5)
    stream.stamp_offset_s = -900.0

    stream.send(5)

    assert stream.check() == Faults()


def test_pairs_that_cannot_be_judged_for_long_are_reported() -> None:
    stream = Stream()
    stream.send(5)

    assert stream.check(failing(2.0)) == Faults()
    assert stream.check(failing(3.25)) == Faults(
        detection='no pair could be judged for 3.2 s: lens covered'
    )
    assert stream.check() == Faults()
    assert stream.recoveries == ['pairs can be judged again']


def test_without_limits_nothing_is_a_fault() -> None:
    stream = Stream(limits=None)

    assert stream.send(50, left=bytes(range(200))) == ''
    stream.wait(10)

    assert stream.check(failing(9.0)) == Faults()
    assert stream.faults == []


def test_changed_limits_apply_at_once() -> None:
    stream, image = Stream(), bytes(range(200))
    stream.send(5, left=image)

    stream.watchdog.configure(dataclasses.replace(LIMITS, frozen_after=2, stale_after_s=1.0))

    assert stream.send(3, left=image).startswith('left image has not changed for 2 frames')
    stream.wait(2)
    assert stream.check().input == 'no images on left and right for 2.0 s'
