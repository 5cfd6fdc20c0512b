"""The command ``rover-obstacles``; each subcommand has its own module."""

from __future__ import annotations

import argparse
import contextlib
import errno
import importlib
import os
import shlex
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from types import FrameType

from rover_obstacle_detection import __version__
from rover_obstacle_detection.cli.arguments import unrecognized
from rover_obstacle_detection.cli.console import report_error, warnings_on_stderr
from rover_obstacle_detection.errors import ObstacleDetectionError, failure_text

COMMAND_MODULES = (
    'rover_obstacle_detection.cli.replay_command',
    'rover_obstacle_detection.cli.inspect_command',
    'rover_obstacle_detection.cli.detect_command',
    'rover_obstacle_detection.cli.run_command',
    'rover_obstacle_detection.cli.play_command',
    'rover_obstacle_detection.cli.evaluate_command',
    'rover_obstacle_detection.cli.simulate_command',
    'rover_obstacle_detection.cli.tune_command',
)
# What the offline commands import and apt's ROS 2 does not bring.
PIP_PACKAGES = ('lz4', 'mcap', 'rich', 'rosbags', 'ruamel.yaml')
FAILED = 1
INTERRUPTED = 130
TERMINATED = 143

# What the loader says of a library, and Python of a thread, that there is no memory for.
_LACKS_OF_MEMORY = (
    'failed to map segment',
    'cannot allocate memory',
    'Cannot allocate memory',
    "can't start new thread",
    'Insufficient memory',
)

DESCRIPTION = """\
Detect rocks, steep slopes and hollows in stereo images of planetary terrain.
"""
EPILOG = """\
For help on a command: rover-obstacles replay --help

Exit status: 0 success, 1 error (one line on stderr), 2 usage error.
"""


def make_parser() -> argparse.ArgumentParser:
    """Build the parser with all subcommands, without importing anything slow."""
    parser = argparse.ArgumentParser(
        prog='rover-obstacles',
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    subparsers = parser.add_subparsers(title='commands', metavar='COMMAND', required=True)
    for module in COMMAND_MODULES:
        importlib.import_module(module).add_parser(subparsers)
    for subparser in subparsers.choices.values():
        subparser.set_defaults(subparser=subparser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand.

    Returns
    -------
    int
        Exit status: 0 success, 1 known error (one line on stderr), 130 interrupted.

    Raises
    ------
    SystemExit
        Status 2 on a usage error, 0 after ``--help`` and ``--version``, 143 on SIGTERM.
    """
    try:
        return _run(argv)
    except ObstacleDetectionError as error:
        report_error(str(error))
        return FAILED
    except BrokenPipeError:
        # The reader of stdout has closed the pipe. The results are already written.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print('rover-obstacles: interrupted', file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if lack := lack_of_memory(error):
            report_error(f'out of memory: {lack}')
        elif lack := missing_package(error):
            report_error(f'{lack} is not installed: pip install {" ".join(PIP_PACKAGES)}')
        elif isinstance(error, OSError):
            report_error(str(error))
        else:
            raise
        return FAILED


def _run(argv: Sequence[str] | None) -> int:
    parser = make_parser()
    words = sys.argv[1:] if argv is None else argv
    arguments, unknown = parser.parse_known_args(words)
    if unknown:
        arguments.subparser.error(unrecognized(unknown, arguments.subparser))
    arguments.command_line = shlex.join(('rover-obstacles', *words))
    try:
        with _termination_unwinds(), warnings_on_stderr():
            return int(arguments.run(arguments))
    except argparse.ArgumentTypeError as error:
        # Arguments that are valid one by one but not together.
        subparser: argparse.ArgumentParser = arguments.subparser
        subparser.error(str(error))


def missing_package(error: BaseException) -> str:
    """Return which of the packages from pip is missing, if that is the error; otherwise ''."""
    module = error.name or '' if isinstance(error, ModuleNotFoundError) else ''
    found = (each for each in PIP_PACKAGES if each.partition('.')[0] == module.partition('.')[0])
    return next(found, '')


def lack_of_memory(error: BaseException) -> str:
    """Return which allocation has failed, if that is what an error says; otherwise ''."""
    while error.__cause__ is not None and not isinstance(error, MemoryError):
        error = error.__cause__
    text = failure_text(error)
    is_lack = (
        isinstance(error, MemoryError)
        or getattr(error, 'errno', None) == errno.ENOMEM
        # OpenCV's StsNoMem.
        or (type(error).__module__ == 'cv2' and getattr(error, 'code', None) == -4)
        or any(each in text for each in _LACKS_OF_MEMORY)
    )
    return text if is_lack else ''


@contextlib.contextmanager
def _termination_unwinds() -> Iterator[None]:
    """Let SIGTERM unwind the stack as Ctrl-C does, so that partial output is removed."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def unwind(number: int, frame: FrameType | None) -> None:
        raise SystemExit(TERMINATED)

    before = signal.signal(signal.SIGTERM, unwind)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
