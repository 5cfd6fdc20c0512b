"""``rover-obstacles evaluate``: compare methods with the labels of labelled bags."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rover_obstacle_detection.cli.arguments import (
    add_command,
    add_parameter_arguments,
    add_recording_arguments,
    add_scheduler_argument,
    detector_config,
    positive_int,
)
from rover_obstacle_detection.cli.calibration_arguments import (
    add_calibration_arguments,
    calibration_request,
)
from rover_obstacle_detection.cli.console import (
    print_table,
    progress_bars,
    report_error,
    report_failures,
    report_interruption,
)
from rover_obstacle_detection.cli.interruption import Interruption
from rover_obstacle_detection.errors import NothingDoneError, ObstacleDetectionError
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS

if TYPE_CHECKING:
    from rover_obstacle_detection.detection.config import DetectorConfig
    from rover_obstacle_detection.evaluation.results import Evaluation
    from rover_obstacle_detection.offline.evaluate import BagOptions

DESCRIPTION = """\
Evaluate detection methods on labelled bags: pixel figures, obstacles found, false alarms, time.

A labelled bag has, in addition to the stereo images and with the same stamps:
  /truth/labels      mono8: 0 free, 1 rock, 2 slope, 3 drop, 255 not counted
  /truth/instances   mono16, optional: 0 ground, 1 and up: number of the rock
  /truth/depth       32FC1, optional: metres along the optical axis

methods:
"""
EPILOG = """\
examples:
  rover-obstacles evaluate bags/mars_yard
  rover-obstacles evaluate suite/report_* --method all --report report.html --json figures.json
  rover-obstacles evaluate bag/ --method hybrid --method study --set max_step=0.15
  rover-obstacles evaluate /data/suite/* --scheduler tcp://rack1:8786 --report report.html
"""
ALL = 'all'
METHOD_LINES = ''.join(f'  {name:11} {text}\n' for name, text in METHOD_DESCRIPTIONS.items())
WORST_PICTURES = 10


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    summary = 'evaluate methods on labelled bags'
    parser = add_command(subparsers, 'evaluate', summary, DESCRIPTION + METHOD_LINES, EPILOG)
    parser.add_argument(
        'bags',
        nargs='+',
        metavar='BAG',
        type=Path,
        help='labelled bag: rosbag2 folder or file (.mcap, .db3), or rosbag1 file (.bag)',
    )
    parser.add_argument(
        '--method',
        action='append',
        choices=(*METHOD_DESCRIPTIONS, ALL),
        dest='methods',
        help='method to evaluate, or all that are installed; may be repeated (default: hybrid)',
    )
    _add_input_arguments(parser)
    add_calibration_arguments(parser, ' (default: from the bag)')
    add_parameter_arguments(parser.add_argument_group('parameters'))
    _add_output_arguments(parser)
    parser.set_defaults(run=run)


def _add_input_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('input')
    add_recording_arguments(group)
    group.add_argument(
        '--labels-topic',
        metavar='TOPIC',
        help='topic of the labels; instances and depth are expected next to it '
        '(default: the topic ending in truth/labels)',
    )
    group.add_argument(
        '--condition',
        metavar='NAME',
        action='append',
        default=[],
        dest='conditions',
        help='condition of all bags, for the tables; may be repeated (default: from /truth/scene '
        'or the name of the bag: vga_noon for report_vga_noon)',
    )


def _add_output_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('output')
    group.add_argument('--json', metavar='FILE', type=Path, help='write all figures to this file')
    group.add_argument(
        '--report',
        metavar='FILE',
        type=Path,
        help='write an HTML report with plots and the worst frames; also runs the methods at '
        'other clearances (needs the extra "report")',
    )
    group.add_argument('--force', action='store_true', help='replace existing files')
    group.add_argument(
        '--repeat',
        metavar='N',
        type=positive_int,
        default=3,
        help='runs of each method on each frame, for the median time; slow methods run fewer '
        'times (default: 3)',
    )
    add_scheduler_argument(group)


def run(arguments: argparse.Namespace) -> int:
    """Evaluate the bags and print the tables."""
    from rover_obstacle_detection.evaluation.runner import RunOptions
    from rover_obstacle_detection.offline.evaluate import evaluate_bags
    from rover_obstacle_detection.offline.output_file import atomic_write_json, atomic_write_text

    config = detector_config(arguments)
    _check_outputs(arguments)
    options = RunOptions(
        methods=_methods(arguments.methods or ['hybrid'], config),
        config=config,
        repeat=arguments.repeat,
        curve=arguments.report is not None,
        worst_pictures=WORST_PICTURES if arguments.report else 0,
    )
    names = [bag.name for bag in arguments.bags]
    with Interruption() as stopped, progress_bars(names, 'frames') as on_progress:
        evaluation, errors = evaluate_bags(
            arguments.bags,
            options,
            _bag_options(arguments),
            on_progress,
            stopped,
            arguments.scheduler or '',
        )
    _report_problems(evaluation, errors, len(names))
    if evaluation.scenes:
        _print_tables(evaluation)
    if evaluation.scenes and arguments.json:
        from rover_obstacle_detection.offline.evaluation_json import evaluation_json

        atomic_write_json(arguments.json, evaluation_json(evaluation, config))
        print(f'figures: {arguments.json}')
    if evaluation.scenes and arguments.report:
        from rover_obstacle_detection.offline.evaluation_report import evaluation_html

        atomic_write_text(arguments.report, evaluation_html(evaluation, config))
        print(f'report: {arguments.report}')
    return stopped.status or (1 if errors else 0)


def _report_problems(
    evaluation: Evaluation, errors: Sequence[ObstacleDetectionError], bags: int
) -> None:
    for line in evaluation.problems:
        report_error(line)
    failures = [error for error in errors if not isinstance(error, NothingDoneError)]
    for error in errors:
        report = report_error if error in failures else report_interruption
        report(str(error))
    report_failures(len(failures), bags)


def _check_outputs(arguments: argparse.Namespace) -> None:
    """Check in advance that the outputs can be written."""
    from rover_obstacle_detection.offline.output_file import check_output_file
    from rover_obstacle_detection.report.extra import require_report_libraries

    if arguments.report:
        require_report_libraries()
    for path in (arguments.json, arguments.report):
        if path is not None:
            check_output_file(path, force=arguments.force)


def _methods(asked: Sequence[str], config: DetectorConfig) -> Sequence[str]:
    """Replace ``all`` by the methods whose libraries are installed."""
    from rover_obstacle_detection.errors import MissingExtraError
    from rover_obstacle_detection.evaluation.methods.registry import make_method

    if ALL not in asked:
        return tuple(dict.fromkeys(asked))
    installed = []
    for name in METHOD_DESCRIPTIONS:
        try:
            make_method(name, config)
            installed.append(name)
        except MissingExtraError as error:
            report_error(f'skipped: {error}')
    return installed


def _bag_options(arguments: argparse.Namespace) -> BagOptions:
    from rover_obstacle_detection.offline.evaluate import BagOptions

    return BagOptions(
        left_topic=arguments.left_topic,
        right_topic=arguments.right_topic,
        labels_topic=arguments.labels_topic,
        rectify=arguments.rectify,
        calibration=calibration_request(arguments),
        every=arguments.every,
        conditions=arguments.conditions,
    )


def _print_tables(evaluation: Evaluation) -> None:
    from rover_obstacle_detection.evaluation.tables import (
        condition_table,
        method_table,
        scene_table,
    )

    tables = []
    for method in evaluation.methods:
        tables.append(scene_table(evaluation, method))
        if len(evaluation.of(method)) > 1:
            tables.append(condition_table(evaluation, method))
    tables.append(method_table(evaluation))
    for table in tables:
        print_table(table)
