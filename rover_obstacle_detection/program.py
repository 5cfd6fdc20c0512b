"""The executables: Ctrl-C is one line or silence, from their first import to their last line."""

from __future__ import annotations

import importlib
import os
import signal
from types import FrameType

INTERRUPTED = 130

IDLE_THREADS = ('OPENCV_THREAD_POOL_ACTIVE_WAIT_WORKER', '200')
"""How often OpenCV's idle threads look for work before they sleep.

OpenCV reads the variable when it is loaded. Its default is 2000, a tenth of a frame's CPU time.
"""


def rover_obstacles() -> int:
    """Run the command ``rover-obstacles``; return its exit status."""
    return _run('rover_obstacle_detection.cli.main')


def obstacle_detector() -> int:
    """Run the executable ``obstacle_detector``; return its exit status."""
    return _run('rover_obstacle_detection.node.main')


def _run(module: str) -> int:
    os.environ.setdefault(*IDLE_THREADS)
    # A shell has a background job ignore Ctrl-C.
    is_interruptible = signal.getsignal(signal.SIGINT) is not signal.SIG_IGN
    try:
        if is_interruptible:
            # An exception in the middle of an import may be lost or become another one.
            signal.signal(signal.SIGINT, _leave)
        main = importlib.import_module(module).main
        if is_interruptible:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            return int(main())
        finally:
            # The interpreter's shutdown would show a traceback.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        return INTERRUPTED


def _leave(number: int, frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
