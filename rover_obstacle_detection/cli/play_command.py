"""``rover-obstacles play``: a recording into the live ROS graph."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rover_obstacle_detection.cli.arguments import positive_seconds, seconds

DESCRIPTION = """\
Publish a recording's topics into the live ROS graph: rosbag2 (mcap, sqlite3) or rosbag1, in the
original timing, reliable, with the original stamps.
"""
EPILOG = """\
Examples:
  rover-obstacles play bags/mars_yard
  rover-obstacles play traverse.bag --rate 0.5 --loop --clock
  rover-obstacles play traverse --ros-args -r /front/left/image_rect:=/stereo/left/image_rect
"""
CLOCK_HZ = 100.0


def positive_number(text: str) -> float:
    """Parse a rate: more than 0."""
    try:
        return positive_seconds(text)
    except argparse.ArgumentTypeError as error:
        msg = f'{text!r}: expected a number above 0'
        raise argparse.ArgumentTypeError(msg) from error


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        'play',
        help='a recording into the live ROS graph',
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('bag', metavar='BAG', type=Path, help='rosbag2 folder or file, or .bag')
    parser.add_argument(
        '--rate', type=positive_number, default=1.0, help='recorded seconds a second (default: 1)'
    )
    parser.add_argument('--loop', action='store_true', help='start again at the end')
    parser.add_argument(
        '--clock',
        metavar='HZ',
        type=positive_number,
        nargs='?',
        const=CLOCK_HZ,
        default=0.0,
        help=f'publish /clock, for nodes with use_sim_time (default: {CLOCK_HZ:g} Hz)',
    )
    parser.add_argument(
        '--start', metavar='S', type=seconds, default=0.0, help='leave out the first S seconds'
    )
    parser.add_argument(
        '--duration', metavar='S', type=positive_seconds, help='play S recorded seconds'
    )
    parser.add_argument('--topics', metavar='TOPIC', nargs='+', default=[], help='only these')
    parser.add_argument(
        '--wait',
        metavar='S',
        type=seconds,
        default=5.0,
        help='wait for a first subscriber, S seconds at most (default: 5)',
    )
    parser.add_argument(
        '--ros-args',
        nargs=argparse.REMAINDER,
        default=[],
        metavar='...',
        help='all that follows goes to ROS 2: -r FROM:=TO, ...',
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Play until the end or a signal."""
    from rover_obstacle_detection.node.player import PlayOptions, play

    options = PlayOptions(
        rate=arguments.rate,
        loop=arguments.loop,
        clock_hz=arguments.clock,
        start_s=arguments.start,
        duration_s=arguments.duration,
        topics=arguments.topics,
        wait_s=arguments.wait,
    )
    play(arguments.bag, options, arguments.ros_args)
    return 0
