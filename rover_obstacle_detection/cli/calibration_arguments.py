"""The options for the calibration of a stereo camera."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rover_obstacle_detection.cli.arguments import finite_number, positive_number

if TYPE_CHECKING:
    from rover_obstacle_detection.calibration_files.request import CalibrationRequest


def add_calibration_arguments(parser: argparse.ArgumentParser, default: str = '') -> None:
    """Add the options that give the calibration as files and as numbers.

    Parameters
    ----------
    parser : ArgumentParser
    default : str
        Where the calibration comes from without these options, for the help.
    """
    group = parser.add_argument_group(
        'calibration',
        # The help keeps the line breaks of this text.
        f'Files, numbers or both{default}. Numbers are those of the\n'
        'rectified camera; the images give its size. A number replaces the value of the\n'
        'files.',
    )
    group.add_argument(
        '--calibration',
        metavar='FILE',
        type=Path,
        action='append',
        help='calibration of both cameras: of Kalibr, OpenCV (YAML or XML) or KITTI; given twice '
        'for intrinsics.yml and extrinsics.yml of OpenCV',
    )
    for side in ('left', 'right'):
        group.add_argument(
            f'--{side}-info',
            metavar='FILE',
            type=Path,
            help=f'calibration of the {side} camera: of ROS camera_calibration, or any of these',
        )
    for name, metavar, kind, text in (
        ('fx', 'PX', positive_number, 'focal length'),
        ('fy', 'PX', positive_number, 'vertical focal length (default: fx)'),
        ('cx', 'PX', finite_number, 'principal point, column (default: image centre)'),
        ('cy', 'PX', finite_number, 'principal point, row (default: image centre)'),
        ('cx-right', 'PX', finite_number, 'column of the right principal point (default: cx)'),
        ('baseline', 'M', positive_number, 'distance of the cameras in metres'),
        ('hfov', 'DEG', positive_number, 'horizontal field of view, in place of --fx'),
    ):
        group.add_argument(f'--{name}', metavar=metavar, type=kind, help=text)


def calibration_request(arguments: argparse.Namespace) -> CalibrationRequest:
    """Return the calibration that the arguments ask for.

    Raises
    ------
    argparse.ArgumentTypeError
        If arguments contradict each other.
    """
    from rover_obstacle_detection.calibration_files.numbers import CameraNumbers
    from rover_obstacle_detection.calibration_files.request import CalibrationRequest

    if arguments.fx is not None and arguments.hfov is not None:
        raise argparse.ArgumentTypeError('--fx and --hfov are both given: expected one of them')
    numbers = CameraNumbers(
        fx=arguments.fx,
        fy=arguments.fy,
        cx=arguments.cx,
        cy=arguments.cy,
        cx_right=arguments.cx_right,
        baseline_m=arguments.baseline,
        hfov_deg=arguments.hfov,
    )
    return CalibrationRequest(_files(arguments), numbers, bool(arguments.calibration))


def _files(arguments: argparse.Namespace) -> tuple[Path, ...]:
    left, right = arguments.left_info, arguments.right_info
    if arguments.calibration:
        if left or right:
            raise argparse.ArgumentTypeError(
                '--calibration is given with --left-info or --right-info: expected either'
            )
        if len(arguments.calibration) > 2:
            raise argparse.ArgumentTypeError(
                f'--calibration is given {len(arguments.calibration)} times: expected one file, '
                'or two of OpenCV'
            )
        return tuple(arguments.calibration)
    if left and right:
        return left, right
    if left or right:
        given, missing = ('left', 'right') if left else ('right', 'left')
        raise argparse.ArgumentTypeError(
            f'--{given}-info is given without --{missing}-info: expected both or neither'
        )
    return ()
