"""Say a thing once, then again every so often while it lasts."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable

REPEAT_S = 10.0
MAX_KINDS = 256


class Throttle:
    """Lets a message through when it is new, and then every ``repeat_s`` seconds.

    Messages that differ in their numbers only are the same message.

    Parameters
    ----------
    say : callable
        What takes the messages that are let through.
    repeat_s : float, optional
    clock : callable, optional
        Seconds of a clock that never jumps; not ROS time, which a bag may stop.
    """

    def __init__(
        self,
        say: Callable[[str], object],
        repeat_s: float = REPEAT_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._say = say
        self._repeat_s = repeat_s
        self._clock = clock
        self._lock = threading.Lock()
        self._last_s: dict[str, float] = {}

    def __call__(self, message: str) -> bool:
        """Say the message if its turn has come; True where it has."""
        kind = re.sub(r'\d+', '#', message)
        now_s = self._clock()
        with self._lock:
            last_s = self._last_s.get(kind)
            if last_s is not None and now_s - last_s < self._repeat_s:
                return False
            if len(self._last_s) >= MAX_KINDS:
                self._last_s.clear()
            self._last_s[kind] = now_s
        self._say(message)
        return True
