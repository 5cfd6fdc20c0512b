"""``rover-obstacles play``: publish a recording on the live ROS graph."""

from __future__ import annotations

import argparse
from pathlib import Path

from rover_obstacle_detection.cli.arguments import (
    add_command,
    add_ros_arguments,
    non_negative_number,
    positive_number,
)

DESCRIPTION = """\
Publish a recording on the live ROS graph, with its original timing and stamps and reliable QoS.
Plays rosbag2 (mcap or sqlite3) and rosbag1.
"""
EPILOG = """\
examples:
  rover-obstacles play bags/mars_yard
  rover-obstacles play traverse.bag --rate 0.5 --loop --clock
  rover-obstacles play traverse --ros-args -r /front/left/image_rect:=/stereo/left/image_rect
"""
CLOCK_HZ = 100.0


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    summary = 'publish a recording on the live ROS graph'
    parser = add_command(subparsers, 'play', summary, DESCRIPTION, EPILOG)
    parser.add_argument(
        'bag',
        metavar='BAG',
        type=Path,
        help='rosbag2 folder or file (.mcap, .db3), or rosbag1 file (.bag)',
    )
    parser.add_argument(
        '--rate', type=positive_number, default=1.0, help='playback speed factor (default: 1)'
    )
    parser.add_argument('--loop', action='store_true', help='repeat until interrupted')
    parser.add_argument(
        '--clock',
        metavar='HZ',
        type=positive_number,
        nargs='?',
        const=CLOCK_HZ,
        default=0.0,
        help=f'publish /clock for nodes with use_sim_time, at {CLOCK_HZ:g} Hz unless HZ is given',
    )
    parser.add_argument(
        '--start',
        metavar='SECONDS',
        type=non_negative_number,
        default=0.0,
        help='seconds to skip at the beginning (default: 0)',
    )
    parser.add_argument(
        '--duration',
        metavar='SECONDS',
        type=positive_number,
        help='recorded seconds to play (default: to the end)',
    )
    parser.add_argument(
        '--topics', metavar='TOPIC', nargs='+', default=[], help='topics to play (default: all)'
    )
    parser.add_argument(
        '--wait',
        metavar='SECONDS',
        type=non_negative_number,
        default=5.0,
        help='seconds to wait for the first subscriber, at most (default: 5)',
    )
    add_ros_arguments(parser, '-r FROM:=TO')
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Play until the end or until interrupted."""
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
