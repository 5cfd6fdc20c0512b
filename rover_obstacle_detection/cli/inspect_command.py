"""``rover-obstacles inspect``: say what recordings hold and how to replay them."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_obstacle_detection.cli.arguments import (
    add_command,
    add_rectify_argument,
    add_side_by_side_argument,
    check_side_by_side,
)
from rover_obstacle_detection.cli.calibration_arguments import (
    add_calibration_arguments,
    calibration_request,
)
from rover_obstacle_detection.cli.console import report_error
from rover_obstacle_detection.errors import ObstacleDetectionError

if TYPE_CHECKING:
    from rover_obstacle_detection.offline.inspection.inspection import InspectionOptions

DESCRIPTION = """\
Say of each recording what it holds, whether it can be replayed, what it lacks, and the command
that replays it. Up to 10 pairs of each stereo camera are measured.

Exit status: 0 if every recording can be replayed, 1 if not.
"""
EPILOG = """\
examples:
  rover-obstacles inspect traverse.mcap
  rover-obstacles inspect day1/ day2/ --json
  rover-obstacles inspect raw.mcap --write-calibration corrected/
  rover-obstacles inspect bag/ --left-topic /port/image_raw --right-topic /starboard/image_raw
  rover-obstacles inspect bag/ --left-topic /zed/image_rect --side-by-side --fx 665 --baseline 0.12
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
        help='rosbag2 folder or file (.mcap, .db3), rosbag1 file (.bag), or folder of images',
    )
    group = parser.add_argument_group('input')
    for side in ('left', 'right'):
        group.add_argument(
            f'--{side}-topic',
            metavar='TOPIC',
            help=f'{side} image topic (default: every stereo camera found by name)',
        )
    add_side_by_side_argument(group)
    add_rectify_argument(group)
    add_calibration_arguments(parser, ' (default: from the bag)')
    output = parser.add_argument_group('output')
    output.add_argument('--json', action='store_true', help='print a JSON list')
    output.add_argument(
        '--write-calibration',
        metavar='DIR',
        type=Path,
        help='write left.yaml and right.yaml with the row misalignment and the lens distortion '
        'corrected that the pairs show; for one bag with one stereo camera',
    )
    output.add_argument(
        '--force', action='store_true', help='replace existing calibration files in DIR'
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Inspect the bags and print what they hold."""
    import json

    from rover_obstacle_detection.offline.inspection.inspection import InspectionOptions

    if arguments.write_calibration and len(arguments.bags) > 1:
        raise argparse.ArgumentTypeError(
            f'--write-calibration is given with {len(arguments.bags)} bags: expected one'
        )
    check_side_by_side(arguments)
    options = InspectionOptions(
        arguments.left_topic,
        arguments.right_topic,
        calibration_request(arguments),
        side_by_side=arguments.side_by_side,
        rectify=arguments.rectify,
    )
    content = []
    for path in arguments.bags:
        try:
            content.append(_inspect(path, options, arguments))
        except ObstacleDetectionError as error:
            report_error(str(error))
            content.append({'bag': str(path), 'can_be_replayed': False, 'error': str(error)})
    if arguments.json:
        print(json.dumps(content, indent=2, allow_nan=False))
    return int(any('error' in each or not each['can_be_replayed'] for each in content))


def _inspect(
    path: Path, options: InspectionOptions, arguments: argparse.Namespace
) -> dict[str, Any]:
    """Inspect one bag and print it, unless everything is printed as JSON; return the JSON."""
    from rover_obstacle_detection.calibration_files.request import CalibrationRequest
    from rover_obstacle_detection.offline.inspection.corrected_calibration import (
        write_corrected_calibration,
    )
    from rover_obstacle_detection.offline.inspection.inspection import inspect_bag
    from rover_obstacle_detection.offline.inspection.text import (
        corrected_json,
        corrected_text,
        inspection_json,
        inspection_text,
    )

    inspection, corrected = inspect_bag(path, options), None
    failure: ObstacleDetectionError | None = None
    if arguments.write_calibration:
        try:
            corrected = write_corrected_calibration(
                inspection, arguments.write_calibration, force=arguments.force
            )
        except ObstacleDetectionError as error:
            # The inspection says why, so it is shown all the same.
            report_error(str(error))
            failure = error
        if corrected and not corrected.for_raw_images:
            inspection = inspect_bag(
                path,
                replace(
                    options,
                    calibration=CalibrationRequest(corrected.files),
                    rectify=corrected.rectify,
                ),
            )
    if not arguments.json:
        print(inspection_text(inspection), flush=True)
        if corrected:
            print(corrected_text(corrected))
        print()
    content = inspection_json(inspection)
    if corrected:
        content['written_calibration'] = corrected_json(corrected)
    if failure:
        content['error'] = str(failure)
    return content
