from __future__ import annotations

from rover_obstacle_detection.node.throttle import MAX_KINDS, Throttle


class Log:
    def __init__(self) -> None:
        self.now_s = 0.0
        self.lines: list[str] = []
        self.throttle = Throttle(self.lines.append, 10.0, lambda: self.now_s)


def test_message_is_repeated_after_ten_seconds() -> None:
    log = Log()

    for now_s in (0.0, 1.0, 9.9, 10.0, 19.0, 20.0):
        log.now_s = now_s
        log.throttle('no calibration')

    assert log.lines == ['no calibration'] * 3


def test_messages_that_differ_only_in_numbers_are_the_same() -> None:
    log = Log()

    log.throttle('data has 12 bytes')
    log.throttle('data has 7 bytes')
    log.throttle('step is 7')

    assert log.lines == ['data has 12 bytes', 'step is 7']


def test_memory_is_bounded() -> None:
    log = Log()

    for number in range(3 * MAX_KINDS):
        log.throttle('x' * number)

    assert len(log.lines) == 3 * MAX_KINDS
    assert len(log.throttle._last_s) <= MAX_KINDS
