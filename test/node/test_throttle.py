from __future__ import annotations

from rover_obstacle_detection.node.throttle import MAX_KINDS, Throttle


class Said:
    def __init__(self) -> None:
        self.now_s = 0.0
        self.lines: list[str] = []
        self.throttle = Throttle(self.lines.append, 10.0, lambda: self.now_s)


def test_says_once_then_again_after_ten_seconds() -> None:
    said = Said()

    for now_s in (0.0, 1.0, 9.9, 10.0, 19.0, 20.0):
        said.now_s = now_s
        said.throttle('no calibration')

    assert said.lines == ['no calibration'] * 3


def test_messages_that_differ_in_numbers_are_the_same() -> None:
    said = Said()

    said.throttle('data has 12 bytes')
    said.throttle('data has 7 bytes')
    said.throttle('step is 7')

    assert said.lines == ['data has 12 bytes', 'step is 7']


def test_memory_is_bounded() -> None:
    said = Said()

    for number in range(3 * MAX_KINDS):
        said.throttle('x' * number)

    assert len(said.lines) == 3 * MAX_KINDS
    assert len(said.throttle._last_s) <= MAX_KINDS
