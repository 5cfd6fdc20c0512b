"""``rover-obstacles replay``: detect obstacles in recorded bags."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from rover_obstacle_detection.cli.arguments import (
    add_command,
    add_detector_arguments,
    add_output_arguments,
    add_recording_arguments,
    detector_config,
    non_negative_number,
    positive_int,
    positive_number,
)
from rover_obstacle_detection.cli.calibration_arguments import (
    add_calibration_arguments,
    calibration_request,
)
from rover_obstacle_detection.cli.console import (
    progress_bars,
    report_error,
    report_interruption,
)
from rover_obstacle_detection.cli.interruption import Interruption
from rover_obstacle_detection.errors import NothingDoneError

if TYPE_CHECKING:
    from rover_obstacle_detection.offline.replay import ReplayOptions

DESCRIPTION = """\
Detect obstacles in recorded bags, rosbag2 (mcap or sqlite3) or rosbag1, and in folders of images.

Writes to DIR, or to DIR/<name of the bag> if there are several bags:
  detections     rosbag2 bag (mcap) with obstacle_mask, obstacle_points and ground_points in the
                 camera's namespace, with the stamps and frames of the left images
  summary.json   counts, parameters, versions, and the figures and times of each frame
  images         with --images: overlay, disparity, regions, seed regions, roughness and step,
                 and obstacle map of each frame
"""
EPILOG = """\
examples:
  rover-obstacles replay traverse.mcap --output traverse_detections --images
  rover-obstacles replay traverse/ -o out --start 60 --duration 30 --every 5
  rover-obstacles replay bag/ -o out --left-topic /cam0/image_raw --right-topic /cam1/image_raw \\
      --left-info left.yaml --right-info right.yaml --approximate-sync 0.005
  rover-obstacles replay images/ -o out --hfov 75 --baseline 0.06
  rover-obstacles replay day1/ day2/ day3/ -o out --workers 3 --set max_step=0.15
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    summary = 'detect obstacles in recorded bags'
    parser = add_command(subparsers, 'replay', summary, DESCRIPTION, EPILOG)
    parser.add_argument(
        'bags',
        nargs='+',
        metavar='BAG',
        type=Path,
        help='rosbag2 folder or file (.mcap, .db3), rosbag1 file (.bag), or folder of images: '
        'EuRoC, KITTI, or left/ and right/',
    )
    _add_input_arguments(parser)
    add_calibration_arguments(parser, ' (default: from the bag)')
    add_detector_arguments(parser)
    output = add_output_arguments(parser)
    output.add_argument('--images', action='store_true', help='write pictures of every frame')
    output.add_argument(
        '--workers',
        metavar='N',
        type=positive_int,
        default=1,
        help='number of bags to process in parallel (default: 1)',
    )
    parser.set_defaults(run=run)


def _add_input_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('input')
    add_recording_arguments(group)
    group.add_argument(
        '--side-by-side',
        action='store_true',
        help='each image of --left-topic shows both views, the left one in its left half',
    )
    group.add_argument(
        '--approximate-sync',
        metavar='SECONDS',
        type=positive_number,
        help='largest stamp difference of a pair (default: stamps must be equal)',
    )
    group.add_argument(
        '--start',
        metavar='SECONDS',
        type=non_negative_number,
        default=0.0,
        help='seconds to skip at the beginning (default: 0)',
    )
    group.add_argument(
        '--duration',
        metavar='SECONDS',
        type=positive_number,
        help='seconds to replay (default: to the end)',
    )
    group.add_argument(
        '--salvage',
        action='store_true',
        help='replay the readable part of a damaged bag (default: refuse the bag)',
    )


def run(arguments: argparse.Namespace) -> int:
    """Replay the bags and print a table of the results."""
    from rich.console import Console

    from rover_obstacle_detection.offline.output_folder import (
        check_output_folder,
        folder_if_filled,
    )
    from rover_obstacle_detection.offline.replay_jobs import plan_jobs, replay_jobs
    from rover_obstacle_detection.offline.summary import ReplaySummary
    from rover_obstacle_detection.offline.summary_table import replay_table

    options = _options(arguments)
    check_output_folder(arguments.output, force=arguments.force)
    jobs = plan_jobs(arguments.bags, arguments.output)
    summaries: dict[int, ReplaySummary] = {}
    stopped = Interruption()
    with (
        stopped,
        folder_if_filled(jobs[0].output.resolve().parent),
        progress_bars([job.output.name for job in jobs], 'pairs') as on_progress,
    ):
        results = replay_jobs(jobs, options, arguments.workers, on_progress, stopped)
        with contextlib.closing(results):
            for index, result in results:
                if isinstance(result, ReplaySummary):
                    summaries[index] = result
                elif isinstance(result, NothingDoneError):
                    report_interruption(str(result))
                else:
                    report_error(str(result))
    if summaries:
        console = Console(highlight=False)
        console.print(replay_table([summaries[index] for index in sorted(summaries)]))
        for index in sorted(summaries):
            _print_paths(jobs[index].output, arguments.images)
    for index, summary in sorted(summaries.items()):
        if summary.interrupted:
            kept = f'{len(summary.frames)} of about {summary.expected} pairs of {summary.bag}'
            report_interruption(f'{kept} are kept in {jobs[index].output}')
    if stopped():
        return stopped.status
    return 0 if len(summaries) == len(jobs) else 1


def _options(arguments: argparse.Namespace) -> ReplayOptions:
    from rover_obstacle_detection.offline.replay import ReplayOptions
    from rover_obstacle_detection.rover_mask import RoverMask

    if arguments.side_by_side and (arguments.right_topic or not arguments.left_topic):
        raise argparse.ArgumentTypeError(
            '--side-by-side: expected --left-topic with both views, and no --right-topic'
        )
    tolerance_s = arguments.approximate_sync
    return ReplayOptions(
        config=detector_config(arguments),
        rover=RoverMask.load(arguments.rover_mask, arguments.rover_polygon),
        left_topic=arguments.left_topic,
        right_topic=arguments.right_topic,
        side_by_side=arguments.side_by_side,
        calibration=calibration_request(arguments),
        tolerance_ns=None if tolerance_s is None else round(1e9 * tolerance_s),
        start_s=arguments.start,
        duration_s=arguments.duration,
        every=arguments.every,
        salvage=arguments.salvage,
        images=arguments.images,
        force=arguments.force,
    )


def _print_paths(output: Path, images: bool) -> None:
    print(f'detections: {output / "detections"}')
    print(f'summary: {output / "summary.json"}')
    if images:
        print(f'images: {output / "images"}')
