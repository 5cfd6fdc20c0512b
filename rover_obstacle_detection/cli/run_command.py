"""``rover-obstacles run``: run the live node."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from rover_obstacle_detection.cli.arguments import add_command, add_ros_arguments
from rover_obstacle_detection.errors import ConfigurationError

# A part may not begin with a digit.
_NAMESPACE = re.compile(r'/|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*/?', re.ASCII)

DESCRIPTION = """\
Run the ROS 2 node obstacle_detector until interrupted with Ctrl-C.

Subscribes to left/image_rect, right/image_rect, left/camera_info and right/camera_info.
--camera subscribes to the topics of a camera driver instead.
Publishes obstacle_mask, obstacle_points, ground_points and more; see docs/node.md.
"""
EPILOG = """\
examples:
  rover-obstacles run --namespace stereo
  rover-obstacles run --namespace stereo --camera realsense
  rover-obstacles run --params obstacle_detector.yaml --ros-args -p max_step:=0.15
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    parser = add_command(subparsers, 'run', 'run the live ROS 2 node', DESCRIPTION, EPILOG)
    parser.add_argument('--params', metavar='YAML', type=Path, help='ROS parameter file')
    parser.add_argument(
        '--namespace',
        metavar='NAME',
        help='namespace of the node and its topics, such as stereo',
    )
    parser.add_argument(
        '--camera',
        metavar='NAME',
        help='camera driver whose topics to subscribe to: zed, zed4, realsense, oak, oak2, '
        'multisense, gazebo or raw; --params and --ros-args take precedence',
    )
    add_ros_arguments(parser, '-p NAME:=VALUE, -r FROM:=TO')
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the node until interrupted."""
    from rover_obstacle_detection.node.main import run_node

    return run_node(ros_arguments(arguments))


def ros_arguments(arguments: argparse.Namespace) -> list[str]:
    """Convert the options to ROS 2 arguments.

    Raises
    ------
    ConfigurationError
        If there is no such camera, or the namespace is not one.
    """
    from rover_obstacle_detection.node.camera_presets import (
        camera_preset,
        parameter_arguments,
        remapping_arguments,
    )

    if arguments.namespace and not _NAMESPACE.fullmatch(arguments.namespace):
        raise ConfigurationError(
            f'namespace is {arguments.namespace!r}: expected letters, digits, _ and / as in '
            'front/stereo'
        )
    preset = None if arguments.camera is None else camera_preset(arguments.camera)
    # Of parameters ROS uses the last one given, of remappings the first.
    given = [] if preset is None else parameter_arguments(preset)
    if arguments.params is not None:
        given += ['--params-file', str(arguments.params)]
    if arguments.namespace:
        given += ['-r', f'__ns:=/{arguments.namespace.strip("/")}']
    given += arguments.ros_args
    return given if preset is None else [*given, *remapping_arguments(preset)]
