"""Argument types and groups that several subcommands share."""

from __future__ import annotations

import argparse
import dataclasses
import difflib
import math
from pathlib import Path
from typing import Any

from rover_obstacle_detection.detection.config import METHODS, DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError

OFFLINE_GRAVITY_SOURCES = ('estimate', 'parameters')
Setting = tuple[str, Any]


def seconds(text: str) -> float:
    """Parse a time span: a number, 0 or more."""
    value = _number(text)
    if value < 0:
        msg = f'{text!r}: expected 0 or more seconds'
        raise argparse.ArgumentTypeError(msg)
    return value


def positive_seconds(text: str) -> float:
    """Parse a time span of more than 0."""
    value = _number(text)
    if value <= 0:
        msg = f'{text!r}: expected more than 0 seconds'
        raise argparse.ArgumentTypeError(msg)
    return value


def positive_int(text: str) -> int:
    """Parse a whole number, 1 or more."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        msg = f'{text!r}: expected a whole number, 1 or more'
        raise argparse.ArgumentTypeError(msg)
    return value


def setting(text: str) -> Setting:
    """Parse ``name=value`` into a detector parameter and its value of the right type."""
    name, equals, value_text = text.partition('=')
    if not equals:
        msg = f'{text!r}: expected name=value, such as max_step=0.15'
        raise argparse.ArgumentTypeError(msg)
    descriptions = {each.name: each for each in DetectorConfig.parameters()}
    if name not in descriptions:
        near = difflib.get_close_matches(name, descriptions, n=1)
        hint = f'did you mean {near[0]}?' if near else f'expected one of {", ".join(descriptions)}'
        msg = f'{name!r} is not a parameter of the detector: {hint}'
        raise argparse.ArgumentTypeError(msg)
    value = _typed(value_text, type(descriptions[name].default))
    try:
        descriptions[name].check(value)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return name, value


def add_calibration_arguments(
    group: argparse._ArgumentGroup, *, required: bool, when_missing: str = ''
) -> None:
    """Add ``--left-info`` and ``--right-info``."""
    for side in ('left', 'right'):
        group.add_argument(
            f'--{side}-info',
            metavar='YAML',
            type=Path,
            required=required,
            help=f'calibration of the {side} camera, as ROS camera_calibration writes it'
            f'{when_missing}',
        )


def add_recording_arguments(group: argparse._ArgumentGroup) -> None:
    """Add what chooses the images and the calibration of a recording."""
    for side in ('left', 'right'):
        group.add_argument(
            f'--{side}-topic',
            metavar='TOPIC',
            help=f'{side} image topic (default: found by its name)',
        )
    add_calibration_arguments(group, required=False, when_missing=' (default: from the bag)')
    group.add_argument(
        '--every', metavar='N', type=positive_int, default=1, help='take every N-th pair only'
    )


def calibration_files(arguments: argparse.Namespace) -> tuple[Path, Path] | None:
    """Return both calibration files, or None where none is given.

    Raises
    ------
    argparse.ArgumentTypeError
        If one is given without the other.
    """
    left, right = arguments.left_info, arguments.right_info
    if left and right:
        return left, right
    if left or right:
        given, missing = ('left', 'right') if left else ('right', 'left')
        msg = f'--{given}-info is given without --{missing}-info: expected both or none'
        raise argparse.ArgumentTypeError(msg)
    return None


def add_detector_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the group of options that make the detector's configuration."""
    group = parser.add_argument_group('detector')
    group.add_argument(
        '--method',
        choices=METHODS,
        help='hybrid (the default), or study: the published method as it was written',
    )
    add_parameter_arguments(group)
    group.add_argument(
        '--rover-mask',
        metavar='PNG',
        default='',
        help='picture that is not black where the left image shows the rover itself',
    )
    group.add_argument(
        '--rover-polygon',
        metavar='CORNERS',
        default='',
        help='the same as a polygon in pixels, such as [[0,600],[1023,600],[1023,767],[0,767]]',
    )


def add_parameter_arguments(group: argparse._ArgumentGroup) -> None:
    """Add ``--params`` and ``--set``."""
    group.add_argument(
        '--params', metavar='YAML', type=Path, help='ROS parameter file, as the node takes it'
    )
    group.add_argument(
        '--set',
        metavar='NAME=VALUE',
        type=setting,
        action='append',
        default=[],
        dest='settings',
        help='one parameter, over the parameter file; may be repeated',
    )


def detector_config(arguments: argparse.Namespace) -> DetectorConfig:
    """Make the configuration: parameter file, then ``--set``, then ``--method``.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, the parameters contradict each other, or the vertical is to
        come from what only a live node has.
    """
    config = DetectorConfig()
    if arguments.params:
        from rover_obstacle_detection.parameter_file import load_config

        config = load_config(arguments.params)
    changes: dict[str, Any] = dict(arguments.settings)
    if arguments.method:
        changes['method'] = arguments.method
    config = dataclasses.replace(config, **changes)
    if config.gravity_source not in OFFLINE_GRAVITY_SOURCES:
        msg = (
            f'gravity_source is {config.gravity_source!r}, which only the live node follows: '
            f'expected {" or ".join(OFFLINE_GRAVITY_SOURCES)}'
        )
        raise ConfigurationError(msg)
    return config


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        msg = f'{text!r}: expected a number'
        raise argparse.ArgumentTypeError(msg)
    return value


def _typed(text: str, kind: type) -> Any:
    """Read a value as its parameter's type; a text that does not fit is left to the check."""
    if kind is bool:
        return {'true': True, 'false': False}.get(text.lower(), text)
    try:
        return kind(text)
    except ValueError:
        return text
