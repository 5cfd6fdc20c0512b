"""Entry point of the node's process."""

from __future__ import annotations

import argparse
import itertools
import re
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from typing import Any

from rover_obstacle_detection.errors import ConfigurationError, ObstacleDetectionError
from rover_obstacle_detection.node.allocator import return_freed_memory
from rover_obstacle_detection.node.process import StopSignals, ros
from rover_obstacle_detection.node.throttle import Throttle
from rover_obstacle_detection.parameter_file import NODE_NAME, check_node_file


def main(argv: Sequence[str] | None = None) -> int:
    """Run the executable ``obstacle_detector`` until Ctrl-C or SIGTERM.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments without the program name, such as ``--ros-args -p max_step:=0.15``.

    Returns
    -------
    int
        0, or 1 after an error, which is printed on one line to stderr.
    """
    parser = argparse.ArgumentParser(
        prog='obstacle_detector',
        description='ROS 2 node: rectified stereo pairs in, obstacle mask and clouds out.',
    )
    parser.add_argument(
        '--ros-args',
        nargs=argparse.REMAINDER,
        default=[],
        metavar='...',
        help='ROS 2 arguments up to the end: -p NAME:=VALUE, -r FROM:=TO, --params-file YAML',
    )
    arguments = parser.parse_args(argv)
    try:
        return run_node(arguments.ros_args)
    except ObstacleDetectionError as error:
        print(f'obstacle_detector: error: {error}', file=sys.stderr)
        return 1


def run_node(ros_arguments: Sequence[str]) -> int:
    """Run the node until Ctrl-C or SIGTERM; repeated signals are harmless.

    Returns
    -------
    int
        0

    Raises
    ------
    ObstacleDetectionError
        If rclpy is missing or the node cannot start.
    """
    check_parameter_files(ros_arguments)
    return_freed_memory()
    stop = StopSignals()
    try:
        with ros(ros_arguments) as warning:
            _spin(stop, warning)
    finally:
        stop.ignore()
    return 0


def check_parameter_files(ros_arguments: Sequence[str]) -> None:
    """Check that each file given with ``--params-file`` sets something of the node.

    Raises
    ------
    ConfigurationError
        If one does not; ROS would ignore it silently.
    """
    name = full_name(ros_arguments)
    for option, value in itertools.pairwise(ros_arguments):
        if option == '--params-file':
            check_node_file(value, name)


def full_name(ros_arguments: Sequence[str]) -> str:
    """Return the node's name and namespace, which ROS arguments can change."""
    names = {'ns': '/', 'node': NODE_NAME}
    for option, value in itertools.pairwise(ros_arguments):
        found = re.fullmatch(rf'({NODE_NAME}:)?__(ns|node|name):=(.*)', value)
        if option in ('-r', '--remap') and found:
            names['ns' if found[2] == 'ns' else 'node'] = found[3]
    return f'/{names["ns"].strip("/")}/{names["node"]}'.replace('//', '/')


def _spin(stop: StopSignals, warning: str | None) -> None:
    # Imported here because the transport profile must be set before rclpy is loaded.
    from rclpy.executors import SingleThreadedExecutor

    from rover_obstacle_detection.node.obstacle_detector import ObstacleDetector

    try:
        node = ObstacleDetector()
    except RuntimeError as error:
        # rclpy's RCLError, as under SROS 2 without Fast DDS's security libraries.
        msg = ' '.join(str(error).split())
        raise ConfigurationError(msg) from error
    try:
        if warning is not None:
            node.get_logger().warning(warning)
        node.start()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        logger = node.get_logger()
        # rclpy allows only one severity for each line that logs, and Throttle is one for all.
        spinner = Spinner(executor, lambda text: logger.error(text), stop.request)
        stop.wait()
        spinner.stop()
    finally:
        node.close()


class Spinner:
    """Runs an executor in a thread and survives exceptions in callbacks.

    Parameters
    ----------
    executor : rclpy executor
    log : callable
        Logs an error.
    on_end : callable
        Called if the ROS context is shut down.
    """

    def __init__(
        self, executor: Any, log: Callable[[str], object], on_end: Callable[[], None]
    ) -> None:
        self._executor = executor
        self._log = Throttle(log)
        self._on_end = on_end
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name='executor', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread after the running callback."""
        self._stopped.set()
        self._executor.wake()
        self._thread.join()
        self._executor.shutdown()

    def _run(self) -> None:
        while not self._stopped.is_set():
            if not self._executor.context.ok():
                self._on_end()
                return
            try:
                self._executor.spin_once()
            except Exception:
                # An unforeseen message must not stop the node.
                self._log(f'callback failed: {traceback.format_exc()}')


if __name__ == '__main__':
    sys.exit(main())
