"""Log a message once, then at intervals while it persists."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from rover_obstacle_detection.warning_kinds import kind_of

REPEAT_S = 10.0
# Bounds the memory for messages that never repeat.
MAX_KINDS = 256


class Throttle:
    """Passes a new message on, then repeats it at most every ``repeat_s`` seconds.

    Messages that differ only in their numbers count as the same.

    Parameters
    ----------
    log : callable
        Receives the messages passed on.
    repeat_s : float, optional
    clock : callable, optional
        Monotonic clock (s); not ROS time, which a recording can stop.
    """

    def __init__(
        self,
        log: Callable[[str], object],
        repeat_s: float = REPEAT_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._log = log
        self._repeat_s = repeat_s
        self._clock = clock
        self._lock = threading.Lock()
        self._last_s: dict[str, float] = {}

    def __call__(self, message: str) -> None:
        """Pass the message on if it is new or due again."""
        kind = kind_of(message)
        now_s = self._clock()
        with self._lock:
            last_s = self._last_s.get(kind)
            if last_s is not None and now_s - last_s < self._repeat_s:
                return
            if len(self._last_s) >= MAX_KINDS:
                self._last_s.clear()
            self._last_s[kind] = now_s
        self._log(message)
