"""``rover-obstacles detect``: one pair of image files in, obstacles out."""

from __future__ import annotations

import argparse
from pathlib import Path

from rover_obstacle_detection.cli.arguments import (
    add_calibration_arguments,
    add_detector_arguments,
    detector_config,
)

DESCRIPTION = """\
Run the detector over one rectified pair of image files.

Writes into DIR:
  mask.png       0 free, 255 obstacle
  overlay.png    the obstacles drawn into the left image, with height and distance
  points.ply     x y z height obstacle, and colours; left optical frame, metres
  summary.json   parameters, versions, times, and each obstacle's figures
  disparity, regions, seeds, roughness_step, obstacle_map (.png): the steps on the way
"""
EPILOG = """\
example:
  rover-obstacles detect left.png right.png --left-info left.yaml --right-info right.yaml \\
      --output result
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        'detect',
        help='run the detector over one pair of image files',
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    source = parser.add_argument_group('input')
    for side in ('left', 'right'):
        source.add_argument(
            side, metavar=side.upper(), type=Path, help=f'rectified image of the {side} eye'
        )
    add_calibration_arguments(source, required=True)
    add_detector_arguments(parser)
    output = parser.add_argument_group('output')
    output.add_argument(
        '-o', '--output', metavar='DIR', type=Path, required=True, help='folder for the results'
    )
    output.add_argument(
        '--force',
        action='store_true',
        help='write into a folder that exists: files of an earlier run are replaced, all others '
        'are left as they are',
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Detect in the pair, and print its obstacles."""
    from rich.console import Console

    from rover_obstacle_detection.offline.detect_pair import detect_pair
    from rover_obstacle_detection.offline.output_folder import check_output_folder
    from rover_obstacle_detection.offline.summary_table import obstacle_table
    from rover_obstacle_detection.rover_mask import RoverMask

    check_output_folder(arguments.output, force=arguments.force)
    detection = detect_pair(
        arguments.left,
        arguments.right,
        (arguments.left_info, arguments.right_info),
        detector_config(arguments),
        arguments.output,
        rover=RoverMask.load(arguments.rover_mask, arguments.rover_polygon),
        force=arguments.force,
    )
    Console(highlight=False).print(obstacle_table(detection.obstacles))
    print(f'overlay: {arguments.output / "overlay.png"}')
    return 0
