"""Turn the first Ctrl-C or SIGTERM into a flag, so that a command can end in good order."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Takes note of Ctrl-C or SIGTERM while the block runs; a second one ends the block at once.

    The second raises `KeyboardInterrupt`, or `SystemExit` for SIGTERM.
    """

    def __init__(self) -> None:
        self.status = 0
        """The exit status that the signal calls for: 130, 143, or 0 if none has arrived."""
        self._before: dict[signal.Signals, signal._HANDLER] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            # A shell has a background job ignore Ctrl-C.
            self._before = {
                number: signal.signal(number, self._take)
                for number in SIGNALS
                if signal.getsignal(number) is not signal.SIG_IGN
            }
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def __call__(self) -> bool:
        """Return whether a signal has arrived."""
        return self.status > 0

    def _take(self, number: int, frame: FrameType | None) -> None:
        is_second = self()
        self.status = 128 + number
        if not is_second:
            return
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(self.status)
