"""``rover-obstacles inspect``: say what recordings hold and how to replay them."""

from __future__ import annotations

import argparse
from pathlib import Path

from rover_obstacle_detection.cli.arguments import (
    add_calibration_arguments,
    add_command,
    calibration_files,
)
from rover_obstacle_detection.cli.console import report_error
from rover_obstacle_detection.errors import ObstacleDetectionError

DESCRIPTION = """\
Say of each recording what it holds, whether it can be replayed, what it lacks, and the command
that replays it. Up to 10 pairs of each stereo camera are measured.

Exit status: 0 if every recording can be replayed, 1 if not.
"""
EPILOG = """\
examples:
  rover-obstacles inspect traverse.mcap
  rover-obstacles inspect day1/ day2/ --json
  rover-obstacles inspect bag/ --left-topic /port/image_raw --right-topic /starboard/image_raw
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    summary = 'say what recordings hold and how to replay them'
    parser = add_command(subparsers, 'inspect', summary, DESCRIPTION, EPILOG)
    parser.add_argument(
        'bags',
        nargs='+',
        metavar='BAG',
        type=Path,
        help='rosbag2 folder or file (.mcap, .db3), or rosbag1 file (.bag)',
    )
    group = parser.add_argument_group('input')
    for side in ('left', 'right'):
        group.add_argument(
            f'--{side}-topic',
            metavar='TOPIC',
            help=f'{side} image topic (default: every stereo camera found by name)',
        )
    add_calibration_arguments(group, required=False, when_missing=' (default: from the bag)')
    output = parser.add_argument_group('output')
    output.add_argument('--json', action='store_true', help='print a JSON list')
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Inspect the bags and print what they hold."""
    import json

    from rover_obstacle_detection.offline.inspection.inspection import (
        InspectionOptions,
        inspect_bag,
    )
    from rover_obstacle_detection.offline.inspection.text import inspection_json, inspection_text

    options = InspectionOptions(
        arguments.left_topic, arguments.right_topic, calibration_files(arguments)
    )
    content = []
    failed = False
    for path in arguments.bags:
        try:
            inspection = inspect_bag(path, options)
        except ObstacleDetectionError as error:
            report_error(str(error))
            content.append({'bag': str(path), 'can_be_replayed': False, 'error': str(error)})
            failed = True
            continue
        content.append(inspection_json(inspection))
        failed |= not inspection.can_be_replayed
        if not arguments.json:
            print(inspection_text(inspection), end='\n\n', flush=True)
    if arguments.json:
        print(json.dumps(content, indent=2, allow_nan=False))
    return int(failed)
