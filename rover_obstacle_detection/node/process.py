"""What the node's and the player's processes have in common: signals, and ROS set up and down."""

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
    """Turns Ctrl-C and SIGTERM into something to wait for, once or as often as they come.

    Under ``ros2 launch`` Ctrl-C arrives twice, and the second must not break the clean-up. To be
    made in the main thread, before anything else starts.
    """

    def __init__(self) -> None:
        # A pipe and not a threading.Event: a handler that sets an event may deadlock with the
        # main thread, which is just about to wait for it.
        self._read, self._write = os.pipe()
        os.set_blocking(self._write, False)
        for number in SIGNALS:
            signal.signal(number, lambda number, frame: None)
        signal.set_wakeup_fd(self._write, warn_on_full_buffer=False)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for a signal; True if one has come, now or before."""
        ready, _, _ = select.select([self._read], [], [], timeout_s)
        return bool(ready)

    def request(self) -> None:
        """Ask for the end as a signal would; from any thread."""
        os.write(self._write, b'\0')

    def ignore(self) -> None:
        """Let later signals pass, so that none meets Python in the middle of its own end."""
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def ros(ros_arguments: Sequence[str]) -> Iterator[str | None]:
    """Set rclpy up, with a transport for large messages, and down again.

    Parameters
    ----------
    ros_arguments : sequence of str
        Such as ``-p max_step:=0.15``, without ``--ros-args``.

    Yields
    ------
    str or None
        A line to warn the user with, where large messages will be lost.

    Raises
    ------
    MissingExtraError
        If rclpy or a middleware is not installed.
    ConfigurationError
        If rclpy does not understand the arguments.
    """
    warning = use_large_message_profile()
    try:
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ImportError as error:
        msg = (
            f'rclpy is not installed ({error}): source your ROS 2 installation, or '
            "pip install 'rover_obstacle_detection[ros]'"
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
