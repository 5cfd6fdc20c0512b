"""``rover-obstacles run``: the live node."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

DESCRIPTION = """\
Run the ROS 2 node obstacle_detector: left/image_rect, right/image_rect and both camera_info in,
obstacle_mask, obstacle_points, ground_points and more out. Ends with Ctrl-C.
"""
EPILOG = """\
Examples:
  rover-obstacles run --namespace stereo
  rover-obstacles run --params obstacle_detector.yaml --ros-args -p max_step:=0.15
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        'run',
        help='the live ROS 2 node',
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--params', metavar='YAML', type=Path, help='ROS parameter file')
    parser.add_argument(
        '--namespace', metavar='NAME', help='namespace of the node and its topics, such as stereo'
    )
    parser.add_argument(
        '--ros-args',
        nargs=argparse.REMAINDER,
        default=[],
        metavar='...',
        help='all that follows goes to ROS 2: -p NAME:=VALUE, -r FROM:=TO, ...',
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run until a signal comes."""
    from rover_obstacle_detection.node.main import run_node

    return run_node(ros_arguments(arguments))


def ros_arguments(arguments: argparse.Namespace) -> list[str]:
    """Write the options the way ROS 2 takes them."""
    given = []
    if arguments.params is not None:
        given += ['--params-file', str(arguments.params)]
    if arguments.namespace:
        given += ['-r', f'__ns:=/{arguments.namespace.strip("/")}']
    return [*given, *arguments.ros_args]
