"""Argument types and options shared by several subcommands."""

from __future__ import annotations

import argparse
import dataclasses
import difflib
import logging
import math
from pathlib import Path
from typing import Any

from rover_obstacle_detection.detection.config import METHODS, DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError

_logger = logging.getLogger(__name__)

# The other sources need a running ROS graph.
OFFLINE_GRAVITY_SOURCES = ('estimate', 'parameters')
Setting = tuple[str, Any]
# Nanoseconds, pixels and metres of larger numbers overflow.
MAX_NUMBER = 1e9
# Those of messages.raw_images.RECTIFY, without importing OpenCV.
RECTIFY = ('by_name', 'always', 'never')


def add_command(
    subparsers: argparse._SubParsersAction[argparse.ArgumentParser],
    name: str,
    summary: str,
    description: str,
    epilog: str,
    usage: str | None = None,
) -> argparse.ArgumentParser:
    """Add a subcommand whose help keeps the line breaks of its texts.

    Without `usage`, argparse lists all options.
    """
    return subparsers.add_parser(
        name,
        help=summary,
        description=description,
        epilog=epilog,
        usage=usage,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def unrecognized(words: list[str], parser: argparse.ArgumentParser) -> str:
    """Name the words that a subcommand does not take, and the options that may be meant."""
    options = parser._option_string_actions
    near = [difflib.get_close_matches(each.partition('=')[0], options, n=1) for each in words]
    meant = dict.fromkeys(match for matches in near for match in matches)
    hint = f': did you mean {" or ".join(meant)}?' if meant else ''
    return f'unrecognized arguments: {" ".join(words)}{hint}'


def non_negative_number(text: str) -> float:
    """Parse a finite number, 0 or more."""
    value = _number(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text!r}: expected 0 or more')
    return value


def positive_number(text: str) -> float:
    """Parse a finite number above 0."""
    value = _number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f'{text!r}: expected a number above 0')
    return value


def finite_number(text: str) -> float:
    """Parse a finite number."""
    return _number(text)


def positive_int(text: str) -> int:
    """Parse a whole number, 1 or more."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f'{text!r}: expected a whole number, 1 or more')
    return value


def setting(text: str) -> Setting:
    """Parse ``name=value`` into a detector parameter and a value of its type."""
    name, equals, value_text = text.partition('=')
    if not equals:
        raise argparse.ArgumentTypeError(
            f'{text!r}: expected name=value, for example max_step=0.15'
        )
    descriptions = {each.name: each for each in DetectorConfig.parameters()}
    if name not in descriptions:
        near = difflib.get_close_matches(name, descriptions, n=1)
        hint = f'did you mean {near[0]}?' if near else f'expected one of {", ".join(descriptions)}'
        raise argparse.ArgumentTypeError(f'{name!r} is not a parameter of the detector: {hint}')
    value = _typed(value_text, type(descriptions[name].default))
    try:
        descriptions[name].check(value)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return name, value


def add_recording_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the options for a recording's topics, ``--rectify`` and ``--every``."""
    add_topic_arguments(group)
    add_rectify_argument(group)
    add_every_argument(group)


def add_topic_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the options for a recording's topics."""
    for side in ('left', 'right'):
        group.add_argument(
            f'--{side}-topic',
            metavar='TOPIC',
            help=f'{side} image topic (default: found by name)',
        )


def add_rectify_argument(group: argparse._ArgumentGroup) -> None:
    """Add ``--rectify``."""
    group.add_argument(
        '--rectify',
        choices=RECTIFY,
        default=RECTIFY[0],
        help='which images are raw and are rectified with the calibration: by_name (default) '
        'those of topics without rect in the name',
    )


def add_every_argument(group: argparse._ArgumentGroup) -> None:
    """Add ``--every``."""
    group.add_argument(
        '--every',
        metavar='N',
        type=positive_int,
        default=1,
        help='use only every N-th pair (default: 1)',
    )


def add_side_by_side_argument(group: argparse._ArgumentGroup) -> None:
    """Add ``--side-by-side`` for a topic whose images show both views."""
    group.add_argument(
        '--side-by-side',
        action='store_true',
        help='each image of --left-topic shows both views, the left one in its left half',
    )


def check_side_by_side(arguments: argparse.Namespace) -> None:
    """Check that ``--side-by-side`` comes with the one topic that it is about.

    Raises
    ------
    argparse.ArgumentTypeError
        If not.
    """
    if arguments.side_by_side and (arguments.right_topic or not arguments.left_topic):
        raise argparse.ArgumentTypeError(
            '--side-by-side: expected --left-topic with both views, and no --right-topic'
        )


def add_detector_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for the detector's configuration and the rover's own pixels."""
    group = parser.add_argument_group('detector')
    add_parameter_arguments(group)
    group.add_argument(
        '--method',
        choices=METHODS,
        help="hybrid (default), or study: the study's method with its errors corrected",
    )
    group.add_argument(
        '--rover-mask',
        metavar='PNG',
        default='',
        help='image that is not black where the left image shows the rover itself',
    )
    group.add_argument(
        '--rover-polygon',
        metavar='CORNERS',
        default='',
        help='the same as a polygon in pixels, for example '
        '[[0,600],[1023,600],[1023,767],[0,767]]',
    )


def add_parameter_arguments(group: argparse._ArgumentGroup) -> None:
    """Add ``--params`` and ``--set``."""
    group.add_argument(
        '--set',
        metavar='NAME=VALUE',
        type=setting,
        action='append',
        default=[],
        dest='settings',
        help='set a parameter, overriding the parameter file; may be repeated',
    )
    group.add_argument(
        '--params', metavar='YAML', type=Path, help='ROS parameter file, the same as for the node'
    )


def detector_config(arguments: argparse.Namespace) -> DetectorConfig:
    """Build the configuration: parameter file, then ``--set``, then ``--method``.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, the parameters contradict each other, or ``gravity_source``
        needs the live node.
    """
    config = DetectorConfig()
    if arguments.params:
        from rover_obstacle_detection.parameter_file import load_config

        config = load_config(arguments.params)
    changes: dict[str, Any] = dict(arguments.settings)
    if method := getattr(arguments, 'method', None):
        changes['method'] = method
    config = dataclasses.replace(config, **changes)
    if config.gravity_source not in OFFLINE_GRAVITY_SOURCES:
        raise ConfigurationError(
            f'gravity_source is {config.gravity_source!r}, which needs the live node: '
            f'expected {" or ".join(OFFLINE_GRAVITY_SOURCES)}'
        )
    if config.without_effect:
        _logger.warning(config.without_effect)
    return config


def add_scheduler_argument(group: argparse._ArgumentGroup) -> None:
    """Add ``--scheduler``."""
    group.add_argument(
        '--scheduler',
        metavar='ADDRESS',
        type=_scheduler,
        default=None,
        help='address of a running Dask scheduler, such as tcp://rack1:8786, whose workers '
        'process the bags; they must find the same paths (needs the extra "cluster")',
    )


def add_output_arguments(
    parser: argparse.ArgumentParser, title: str = 'output'
) -> argparse._ArgumentGroup:
    """Add ``--output`` and ``--force`` for an output folder; return their group."""
    group = parser.add_argument_group(title)
    group.add_argument(
        '-o', '--output', metavar='DIR', type=Path, required=True, help='folder for the results'
    )
    group.add_argument(
        '--force',
        action='store_true',
        help='write into a folder that is not empty; replaces the files of an earlier run and '
        'keeps all others',
    )
    return group


def add_ros_arguments(parser: argparse.ArgumentParser, examples: str) -> None:
    """Add ``--ros-args``, which takes the rest of the command line."""
    parser.add_argument(
        '--ros-args',
        nargs=argparse.REMAINDER,
        default=[],
        metavar='...',
        help=f'pass all remaining arguments to ROS 2: {examples}, ...',
    )


def _scheduler(text: str) -> str:
    # Such as of a variable that is not set.
    if not text.strip():
        raise argparse.ArgumentTypeError(f'{text!r}: expected an address such as tcp://rack1:8786')
    return text


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= MAX_NUMBER:
        raise argparse.ArgumentTypeError(f'{text!r}: expected a number of at most {MAX_NUMBER:g}')
    return value


def _typed(text: str, kind: type) -> Any:
    """Convert text to a parameter's type; invalid text is returned for the check to refuse."""
    if kind is bool:
        return {'true': True, 'false': False}.get(text.lower(), text)
    try:
        return kind(text)
    except ValueError:
        return text
