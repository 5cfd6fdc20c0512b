"""``rover-obstacles detect``: detect obstacles in one pair of image files."""

from __future__ import annotations

import argparse
import logging
import math
from pathlib import Path
from typing import TYPE_CHECKING

from rover_obstacle_detection.cli.arguments import (
    add_command,
    add_detector_arguments,
    add_output_arguments,
    detector_config,
)
from rover_obstacle_detection.cli.calibration_arguments import (
    add_calibration_arguments,
    calibration_request,
)

if TYPE_CHECKING:
    from rover_obstacle_detection.offline.summary import FrameSummary

_logger = logging.getLogger(__name__)

DESCRIPTION = """\
Detect obstacles in one pair of image files: rectified, or raw with --raw.

Writes to DIR:
  mask.png       0 free, 255 obstacle
  overlay.png    left image with the obstacles, their height and distance
  points.ply     position, height, confidence, colour and obstacle flag of each point;
                 left optical frame, metres
  summary.json   parameters, versions, times, and the figures of each obstacle
  disparity.png, regions.png, seeds.png, roughness_step.png, obstacle_map.png
                 intermediate steps
"""
EPILOG = """\
examples:
  rover-obstacles detect left.png right.png --fx 665.1 --baseline 0.06 --output result
  rover-obstacles detect left.png right.png --left-info left.yaml --right-info right.yaml \\
      --output result
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    summary = 'detect obstacles in one pair of image files'
    parser = add_command(subparsers, 'detect', summary, DESCRIPTION, EPILOG)
    source = parser.add_argument_group('input')
    source.add_argument('left', metavar='LEFT', type=Path, help='left image')
    source.add_argument('right', metavar='RIGHT', type=Path, nargs='?', help='right image')
    source.add_argument(
        '--side-by-side',
        action='store_true',
        help='LEFT shows both views, the left one in its left half; there is no RIGHT',
    )
    source.add_argument(
        '--raw',
        action='store_true',
        help='rectify the images with the calibration (default: they are rectified)',
    )
    add_calibration_arguments(parser)
    add_detector_arguments(parser)
    add_output_arguments(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Detect the obstacles; print warnings and a table of the obstacles."""
    from rich.console import Console

    from rover_obstacle_detection.offline.detect_pair import detect_pair
    from rover_obstacle_detection.offline.output_folder import check_output_folder
    from rover_obstacle_detection.offline.summary import FrameSummary
    from rover_obstacle_detection.offline.summary_table import obstacle_table
    from rover_obstacle_detection.pictures import shown_obstacles
    from rover_obstacle_detection.rover_mask import RoverMask

    if arguments.side_by_side == (arguments.right is not None):
        raise argparse.ArgumentTypeError(
            'expected LEFT and RIGHT, or one image and --side-by-side'
        )
    calibration = calibration_request(arguments)
    if not calibration.is_complete:
        raise argparse.ArgumentTypeError(calibration.lack)
    check_output_folder(arguments.output, force=arguments.force)
    detection = detect_pair(
        arguments.left,
        arguments.right,
        calibration,
        detector_config(arguments),
        arguments.output,
        rover=RoverMask.load(arguments.rover_mask, arguments.rover_polygon),
        raw=arguments.raw,
        force=arguments.force,
    )
    for warning in detection.warnings:
        _logger.warning(warning)
    Console(highlight=False).print(obstacle_table(shown_obstacles(detection)))
    print(_ground_text(FrameSummary.of(detection)))
    print(f'overlay: {arguments.output / "overlay.png"}')
    return 0


def _ground_text(figures: FrameSummary) -> str:
    """Say what a ruler and an inclinometer can check."""
    if math.isnan(figures.camera_height_m):
        return 'ground: not found'
    return (
        f'ground: {figures.camera_height_m:.2f} m below the camera, which looks down by '
        f'{figures.camera_pitch_deg:.0f} deg; if that is wrong, check the calibration'
    )
