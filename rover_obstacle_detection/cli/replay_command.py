"""``rover-obstacles replay``: detect obstacles in recorded bags."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rover_obstacle_detection.cli.arguments import (
    add_command,
    add_detector_arguments,
    add_every_argument,
    add_output_arguments,
    add_rectify_argument,
    add_scheduler_argument,
    add_side_by_side_argument,
    add_topic_arguments,
    check_side_by_side,
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
    report_failures,
    report_interruption,
)
from rover_obstacle_detection.cli.interruption import Interruption
from rover_obstacle_detection.errors import NothingDoneError

if TYPE_CHECKING:
    from rover_obstacle_detection.offline.replay_jobs import ReplayJob
    from rover_obstacle_detection.offline.replay_options import ReplayOptions
    from rover_obstacle_detection.offline.summary import ReplaySummary

USAGE = 'rover-obstacles replay BAG [BAG ...] -o DIR [options]'
DESCRIPTION = """\
Detect obstacles in recorded bags, rosbag2 (mcap or sqlite3) or rosbag1, and in
folders of images.

Writes to DIR, or to DIR/<name of the bag> if there are several bags:
  detections     rosbag2 bag (mcap) with obstacle_mask, obstacle_points,
                 ground_points, obstacle_grid, obstacle_markers and
                 detection_image/compressed in the camera's namespace, and
                 /diagnostics, with the stamps and frames of the left images
  summary.json   counts, parameters, versions, figures and times of each frame
  obstacles.csv  one row per frame and obstacle
  images         with --images
  report.html    with --report
  overlays.mp4   with --video
"""
EPILOG = """\
examples:
  rover-obstacles replay drive.mcap --output drive_detections --images
  rover-obstacles replay drive.mcap -o out --report --images overlay,disparity
  rover-obstacles replay drive/ -o out --start 60 --duration 30 --every 5
  rover-obstacles replay images/ -o out --hfov 75 --baseline 0.06
  rover-obstacles replay day1/ day2/ -o out --workers 2 --set max_step=0.15
  rover-obstacles replay /data/day*/ -o /data/out --scheduler tcp://rack1:8786
  rover-obstacles replay bag/ -o out --approximate-sync 0.005 \\
      --left-topic /cam0/image_raw --right-topic /cam1/image_raw \\
      --left-info left.yaml --right-info right.yaml

rover-obstacles inspect says of a bag which of these options it needs.
"""


# Those of offline.picture_files.PICTURE_NAMES, without importing OpenCV.
PICTURES = ('overlay', 'disparity', 'regions', 'seeds', 'roughness_step', 'obstacle_map')


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    summary = 'detect obstacles in recorded bags'
    parser = add_command(subparsers, 'replay', summary, DESCRIPTION, EPILOG, USAGE)
    parser.add_argument(
        'bags',
        nargs='+',
        metavar='BAG',
        type=Path,
        help='rosbag2 folder or file (.mcap, .db3), rosbag1 file (.bag), or folder of images: '
        'EuRoC, KITTI, or left/ and right/',
    )
    _add_common_arguments(parser)
    add_detector_arguments(parser)
    _add_image_arguments(parser)
    add_calibration_arguments(parser, ' (default: from the bag)')
    parser.set_defaults(run=run)


def _add_common_arguments(parser: argparse.ArgumentParser) -> None:
    group = add_output_arguments(parser, 'common options')
    group.add_argument(
        '--images',
        nargs='?',
        metavar='NAMES',
        type=_picture_names,
        const=PICTURES,
        default=(),
        help=f'write pictures of every frame: all, or some of {", ".join(PICTURES)}, with commas '
        'and no spaces',
    )
    group.add_argument(
        '--report',
        action='store_true',
        help='write one page with a timeline, pictures and the worst frames, without external '
        'files (needs the extra "report")',
    )
    group.add_argument('--video', action='store_true', help='write the overlays as a video')
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
    add_every_argument(group)
    group.add_argument(
        '--workers',
        metavar='N',
        type=positive_int,
        default=1,
        help='number of bags to process in parallel on this computer (default: 1)',
    )
    add_scheduler_argument(group)


def _add_image_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('images of the bag')
    add_topic_arguments(group)
    add_side_by_side_argument(group)
    group.add_argument(
        '--approximate-sync',
        metavar='SECONDS',
        type=positive_number,
        help='largest stamp difference of a pair (default: stamps must be equal)',
    )
    add_rectify_argument(group)
    group.add_argument(
        '--salvage',
        action='store_true',
        help='replay the readable part of a damaged bag (default: refuse the bag)',
    )


def _picture_names(text: str) -> tuple[str, ...]:
    names = tuple(text.split(','))
    for name in names:
        if name not in PICTURES:
            raise argparse.ArgumentTypeError(
                f'{name!r} is not a picture: expected some of {",".join(PICTURES)}; a bag has to '
                'stand before --images'
            )
    return names


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

    if arguments.scheduler and arguments.workers > 1:
        raise argparse.ArgumentTypeError('--scheduler: expected no --workers')
    if arguments.report:
        from rover_obstacle_detection.report.extra import require_report_libraries

        require_report_libraries()
    if arguments.video:
        from rover_obstacle_detection.offline.overlay_video import require_encoder

        require_encoder('overlays.mp4')
    options = _options(arguments)
    check_output_folder(arguments.output, force=arguments.force)
    jobs = plan_jobs(arguments.bags, arguments.output)
    summaries: dict[int, ReplaySummary] = {}
    failed = 0
    stopped = Interruption()
    with (
        stopped,
        folder_if_filled(jobs[0].output.resolve().parent),
        progress_bars(_names(jobs), 'pairs') as on_progress,
    ):
        results = replay_jobs(
            jobs, options, arguments.workers, on_progress, stopped, arguments.scheduler or ''
        )
        with contextlib.closing(results):
            for index, result in results:
                if isinstance(result, ReplaySummary):
                    summaries[index] = result
                elif isinstance(result, NothingDoneError):
                    report_interruption(str(result))
                else:
                    failed += 1
                    report_error(str(result))
    report_failures(failed, len(jobs))
    if summaries:
        console = Console(highlight=False)
        console.print(replay_table([summaries[index] for index in sorted(summaries)]))
        for index in sorted(summaries):
            _print_paths(jobs[index].output, options)
        if options.report and len(jobs) > 1:
            _write_combined_report([(jobs[each], summaries[each]) for each in sorted(summaries)])
    for index, summary in sorted(summaries.items()):
        if summary.interrupted:
            kept = f'{len(summary.frames)} of about {summary.expected} pairs of {summary.bag}'
            verb = 'is' if len(summary.frames) == 1 else 'are'
            report_interruption(f'{kept} {verb} kept in {jobs[index].output}')
    if stopped():
        return stopped.status
    return 0 if len(summaries) == len(jobs) else 1


def _write_combined_report(replays: Sequence[tuple[ReplayJob, ReplaySummary]]) -> None:
    from rover_obstacle_detection.offline.combined_report import combined_html
    from rover_obstacle_detection.offline.output_file import atomic_write_text

    path = replays[0][0].output.parent / 'report.html'
    summaries = [summary for _, summary in replays]
    atomic_write_text(path, combined_html([job.output.name for job, _ in replays], summaries))
    print(f'report of all: {path}')


def _names(jobs: Sequence[ReplayJob]) -> list[str]:
    """Return the names of the bags; of several, those of their output folders, which differ."""
    if len(jobs) == 1:
        return [jobs[0].bag.resolve().name]
    return [job.output.name for job in jobs]


def _options(arguments: argparse.Namespace) -> ReplayOptions:
    from rover_obstacle_detection.offline.replay_options import ReplayOptions
    from rover_obstacle_detection.rover_mask import RoverMask

    check_side_by_side(arguments)
    tolerance_s = arguments.approximate_sync
    return ReplayOptions(
        config=detector_config(arguments),
        rover=RoverMask.load(arguments.rover_mask, arguments.rover_polygon),
        left_topic=arguments.left_topic,
        right_topic=arguments.right_topic,
        side_by_side=arguments.side_by_side,
        rectify=arguments.rectify,
        calibration=calibration_request(arguments),
        tolerance_ns=None if tolerance_s is None else round(1e9 * tolerance_s),
        start_s=arguments.start,
        duration_s=arguments.duration,
        every=arguments.every,
        salvage=arguments.salvage,
        images=arguments.images,
        video=arguments.video,
        report=arguments.report,
        command_line=arguments.command_line,
        force=arguments.force,
    )


def _print_paths(output: Path, options: ReplayOptions) -> None:
    print(f'detections: {output / "detections"}')
    print(f'summary: {output / "summary.json"}')
    print(f'obstacles: {output / "obstacles.csv"}')
    if options.images:
        print(f'images: {output / "images"}')
    if options.video:
        print(f'video: {output / "overlays.mp4"}')
    if options.report:
        print(f'report: {output / "report.html"}')
