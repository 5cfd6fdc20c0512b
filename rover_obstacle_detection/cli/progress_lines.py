"""Progress and time left as lines of a log, for output that is not a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence

PERIOD_S = 10.0


class ProgressLines:
    """Prints at most one line every 10 s on stderr, and none in the first 10 s.

    Parameters
    ----------
    tasks : sequence of str
    unit : str
        What is counted, for example ``pairs``.
    clock_s : callable, optional
        A monotonic clock in seconds.
    """

    def __init__(
        self, tasks: Sequence[str], unit: str, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._tasks = tasks
        self._unit = unit
        self._clock_s = clock_s
        self._begun_s: dict[int, float] = {}
        self._updated_s = clock_s()
        self._printed_s: float | None = None

    def update(self, index: int, done: int, expected: int) -> None:
        """Take the number of steps done and expected of a task."""
        now_s = self._clock_s()
        # A task begins when the one before it ends.
        begun_s = self._begun_s.setdefault(index, self._updated_s)
        self._updated_s = now_s
        if self._printed_s is None:
            self._printed_s = now_s
        if now_s - self._printed_s < PERIOD_S or done <= 0:
            return
        self._printed_s = now_s
        done_s = now_s - begun_s
        left_s = done_s * max(expected - done, 0) / done
        print(
            f'{" ".join(self._tasks[index].split())}: {done} of about {expected} {self._unit}, '
            f'{_clock_text(done_s)} done, {_clock_text(left_s)} left',
            file=sys.stderr,
            flush=True,
        )


def _clock_text(seconds: float) -> str:
    """Return a time as ``4:05`` or ``1:04:05``."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f'{hours}:{minutes:02}:{rest:02}' if hours else f'{minutes}:{rest:02}'
