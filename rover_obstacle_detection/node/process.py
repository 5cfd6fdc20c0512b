"""Signal handling and ROS start-up, shared by the node and the player."""

from __future__ import annotations

import contextlib
import os
import select
import signal
from collections.abc import Iterator, Sequence

from rover_obstacle_detection.errors import ConfigurationError, MissingExtraError
from rover_obstacle_detection.node.transport import use_large_message_profile

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopSignals:
    """Turns Ctrl-C and SIGTERM into an event to wait for.

    Under ``ros2 launch`` Ctrl-C arrives twice; the second one must not interrupt the clean-up.
    Create it in the main thread before any other thread starts.
    """

    def __init__(self) -> None:
        # A threading.Event set by a signal handler can deadlock with the thread waiting for it.
        self._read, self._write = os.pipe()
        os.set_blocking(self._write, False)
        for number in SIGNALS:
            signal.signal(number, lambda number, frame: None)
        signal.set_wakeup_fd(self._write, warn_on_full_buffer=False)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for a signal; return whether one has arrived, now or earlier."""
        ready, _, _ = select.select([self._read], [], [], timeout_s)
        return bool(ready)

    def request(self) -> None:
        """Request the end, from any thread."""
        os.write(self._write, b'\0')

    def ignore(self) -> None:
        """Ignore further signals, which could interrupt the interpreter's shutdown."""
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def ros(ros_arguments: Sequence[str]) -> Iterator[str | None]:
    """Initialise rclpy with a transport for large messages; shut it down on exit.

    Parameters
    ----------
    ros_arguments : sequence of str
        For example ``-p max_step:=0.15``, without ``--ros-args``.

    Yields
    ------
    str or None
        A warning if large messages may be lost.

    Raises
    ------
    MissingExtraError
        If rclpy or a middleware is not installed.
    ConfigurationError
        If rclpy rejects the arguments.
    """
    warning = use_large_message_profile()
    try:
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ImportError as error:
        msg = (
            f'rclpy is not installed ({error}): source your ROS 2 installation, or '
            "pip install '.[ros,fast]' in this package's source folder"
        )
        raise MissingExtraError(msg) from error
    arguments = ['--ros-args', *ros_arguments] if ros_arguments else []
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        msg = ' '.join(str(error).split())
        raise ConfigurationError(msg) from error
    try:
        yield warning
    finally:
        rclpy.try_shutdown()
