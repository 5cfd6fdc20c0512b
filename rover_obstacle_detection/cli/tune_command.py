"""``rover-obstacles tune``: optimise parameters on labelled bags."""

from __future__ import annotations

import argparse
import logging
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from rover_obstacle_detection.cli.arguments import (
    add_parameter_arguments,
    add_recording_arguments,
    detector_config,
    positive_int,
    positive_number,
)
from rover_obstacle_detection.cli.calibration_arguments import (
    add_calibration_arguments,
    calibration_request,
)
from rover_obstacle_detection.cli.console import print_table, progress_bars, report_error
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.weights import Weights
from rover_obstacle_detection.wording import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rover_obstacle_detection.detection.config import DetectorConfig
    from rover_obstacle_detection.tuning.scenes import TuningScene
    from rover_obstacle_detection.tuning.tune import TuneOptions, TuningResult

# Names the defaults in words: importing tuning needs Optuna.
DESCRIPTION = """\
Optimise the detector's parameters on labelled bags, and check them on held-out bags (extra tune).

Held-out bags: those of --held-out. Otherwise, if some bags are named tune_* and others report_*,
the latter. Otherwise 30 % of the bags. The output is a complete ROS parameter file for the node
and for --params.

tuned by default: core_share, core_noises, outline_probability, smoothness,
correlation_window_size, uniqueness_ratio, speckle_size
"""
EPILOG = """\
examples:
  rover-obstacles tune suite/* --output tuned.yaml
  rover-obstacles tune day1/ day2/ day3/ --folds 3 --output tuned.yaml --params rover.yaml
  rover-obstacles tune a/ b/ --held-out c/ -o tuned.yaml --parameter core_noises \\
      --range core_noises=0:4 --trials 20
  rover-obstacles replay traverse.mcap --params tuned.yaml --output result
"""
LOGGER = logging.getLogger(__name__)
MEMORY_MB = 2000
MAX_PROBLEMS_SHOWN = 3


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        'tune',
        help='optimise parameters on labelled bags (extra tune)',
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        'bags', nargs='+', metavar='BAG', type=Path, help='labelled bag, as for evaluate'
    )
    _add_input_arguments(parser)
    add_calibration_arguments(parser, ' (default: from the bag)')
    _add_held_out_arguments(parser)
    _add_search_arguments(parser)
    add_parameter_arguments(parser.add_argument_group('initial parameters'))
    output = parser.add_argument_group('output')
    output.add_argument(
        '-o', '--output', metavar='YAML', type=Path, required=True, help='parameter file to write'
    )
    output.add_argument(
        '--json', metavar='FILE', type=Path, help='also write all trials and figures to this file'
    )
    output.add_argument('--force', action='store_true', help='replace existing files')
    parser.set_defaults(run=run)


def _add_input_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('input')
    add_recording_arguments(group)
    group.add_argument(
        '--labels-topic',
        metavar='TOPIC',
        help='topic of the labels; instances are expected next to it (default: truth/labels)',
    )
    group.add_argument(
        '--memory',
        metavar='MB',
        type=positive_int,
        default=MEMORY_MB,
        help=f'memory limit for the frames, 4 MB each at 1024 x 768 (default: {MEMORY_MB})',
    )


def _add_held_out_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('held-out bags').add_mutually_exclusive_group()
    group.add_argument(
        '--held-out',
        nargs='+',
        action='extend',
        metavar='BAG',
        type=Path,
        default=[],
        help='bags to hold out; they may also be among the others',
    )
    group.add_argument(
        '--held-out-share',
        metavar='SHARE',
        type=_number(float, 0, 1, '0 or more, less than 1'),
        help='share of the bags to hold out, chosen by name and seed; 0: none (default: 0.3)',
    )
    group.add_argument(
        '--folds',
        metavar='N',
        type=_number(int, 2, math.inf, '2 or more'),
        help='cross-validate: tune on all bags, and once without each of N folds. Takes N + 1 '
        'times as long; more reliable with few bags',
    )


def _add_search_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('search')
    group.add_argument(
        '--parameter',
        metavar='NAME',
        action='append',
        default=[],
        dest='parameters',
        help='tune this parameter instead of the default ones; may be repeated',
    )
    group.add_argument(
        '--range',
        metavar='NAME=LOW:HIGH',
        type=_range,
        action='append',
        default=[],
        dest='ranges',
        help='range of a parameter; may be repeated',
    )
    group.add_argument(
        '--trials',
        metavar='N',
        type=positive_int,
        default=60,
        help='parameter sets to try, including the initial one (default: 60)',
    )
    group.add_argument(
        '--seconds', metavar='SECONDS', type=positive_number, help='start no trial after this'
    )
    group.add_argument(
        '--seed',
        metavar='N',
        type=_number(int, 0, 2**32, 'a whole number, 0 or more'),
        default=0,
        help='(default: 0)',
    )
    for name, mistake, default in (
        ('missed', 'missing every obstacle', Weights.missed),
        ('false-alarm', 'one false alarm per frame', Weights.false_alarm),
    ):
        group.add_argument(
            f'--{name}-weight',
            metavar='WEIGHT',
            type=_number(float, 0, math.inf, '0 or more'),
            default=default,
            help=f'cost of {mistake}, in units of mean IoU (default: {default:g})',
        )


def _number(
    kind: type[int] | type[float], low: float, end: float, expected: str
) -> Callable[[str], float]:
    """Return an argument type for numbers of at least `low` and less than `end`."""

    def parse(text: str) -> float:
        try:
            value: float = kind(text)
        except ValueError:
            value = math.nan
        if not low <= value < end:
            msg = f'{text!r}: expected {expected}'
            raise argparse.ArgumentTypeError(msg)
        return value

    return parse


def _range(text: str) -> tuple[str, tuple[float, float]]:
    name, _, bounds = text.partition('=')
    try:
        low, high = map(float, bounds.split(':'))
    except ValueError as error:
        msg = f'{text!r}: expected NAME=LOW:HIGH, such as core_noises=0:4'
        raise argparse.ArgumentTypeError(msg) from error
    return name, (low, high)


def run(arguments: argparse.Namespace) -> int:
    """Tune, print the results, and write the parameter file.

    Raises
    ------
    MissingExtraError
        If Optuna is not installed.
    ObstacleDetectionError
        If a bag or parameter file cannot be read, or an output file cannot be written.
    """
    from rover_obstacle_detection.offline.output_file import (
        atomic_write_json,
        atomic_write_text,
        check_output_file,
    )
    from rover_obstacle_detection.tuning.report import parameter_file, tuning_json

    start = detector_config(argparse.Namespace(**{**vars(arguments), 'method': None}))
    options = _options(arguments, start)
    for path in (arguments.output, arguments.json):
        if path is not None:
            check_output_file(path, force=arguments.force)
    result = _result(arguments, start, options)
    _print_result(result, options)
    atomic_write_text(arguments.output, parameter_file(result, options))
    print(f'parameters: {arguments.output}')
    if arguments.json:
        atomic_write_json(arguments.json, tuning_json(result, options))
        print(f'trials and figures: {arguments.json}')
    return 0


def _options(arguments: argparse.Namespace, start: DetectorConfig) -> TuneOptions:
    from rover_obstacle_detection.tuning.space import (
        ROVER_LIMITS,
        check_read_by,
        search_ranges,
    )
    from rover_obstacle_detection.tuning.tune import TuneOptions

    if start.method != 'hybrid' and not arguments.parameters:
        msg = f'the default parameters are those of hybrid: name those of {start.method}'
        raise ConfigurationError(f'{msg} with --parameter')
    try:
        ranges = search_ranges(arguments.parameters, dict(arguments.ranges))
        check_read_by(start.method, ranges)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    for name in ranges:
        if name in ROVER_LIMITS:
            LOGGER.warning('%s is a limit of the rover: labels cannot show a better value', name)
    return TuneOptions(
        ranges=ranges,
        weights=Weights(arguments.missed_weight, arguments.false_alarm_weight),
        trials=arguments.trials,
        seconds=arguments.seconds,
        seed=arguments.seed,
    )


def _result(
    arguments: argparse.Namespace, start: DetectorConfig, options: TuneOptions
) -> TuningResult:
    from rover_obstacle_detection.tuning.split import folds_of, split_bags
    from rover_obstacle_detection.tuning.tune import tune_and_hold_out, tune_in_folds

    bags = arguments.bags
    if arguments.folds:
        folds = folds_of(bags, arguments.folds, arguments.seed)
        scenes = _read(bags, arguments)
        groups = [[scene for scene in scenes if scene.path in fold] for fold in folds]
        tasks = ['all bags', *(f'without fold {number + 1}' for number in range(len(folds)))]
        with progress_bars(tasks, 'trials') as on_progress:
            return tune_in_folds(scenes, groups, start, options, on_progress)
    split = split_bags(bags, arguments.held_out, arguments.held_out_share, arguments.seed)
    scenes = _read((*split.tuned, *split.held_out), arguments)
    tuned, held_out = scenes[: len(split.tuned)], scenes[len(split.tuned) :]
    with progress_bars(['tuning'], 'trials') as on_progress:
        return tune_and_hold_out(tuned, held_out, split.reason, start, options, on_progress)


def _read(paths: Sequence[Path], arguments: argparse.Namespace) -> list[TuningScene]:
    from rover_obstacle_detection.offline.evaluate import BagOptions
    from rover_obstacle_detection.tuning.scenes import MEGABYTE, read_scenes

    options = BagOptions(
        left_topic=arguments.left_topic,
        right_topic=arguments.right_topic,
        labels_topic=arguments.labels_topic,
        rectify=arguments.rectify,
        calibration=calibration_request(arguments),
        every=arguments.every,
    )
    with progress_bars([path.name for path in paths], 'frames') as on_progress:
        scenes = read_scenes(paths, options, arguments.memory * MEGABYTE, on_progress)
    for scene in scenes:
        for line in scene.problems[:MAX_PROBLEMS_SHOWN]:
            report_error(line)
        more = len(scene.problems) - MAX_PROBLEMS_SHOWN
        if more > 0:
            report_error(f'{scene.path}: {more} more problems')
    return scenes


def _print_result(result: TuningResult, options: TuneOptions) -> None:
    from rover_obstacle_detection.tuning import report
    from rover_obstacle_detection.tuning.tune import ALL_TRIALS

    tuning = result.tuning
    tables = [report.scene_table(result.tuned, 'Tuned on')]
    if result.held_out is not None:
        tables.append(report.scene_table(result.held_out, f'Held out ({result.reason})'))
    tables.append(report.summary_table(result, options.weights))
    tables.append(report.parameter_table(tuning, options))
    for table in tables:
        print_table(table)
    if result.folds:
        print(
            'The final parameters are tuned on all bags. The held-out figures of each bag come '
            'from a search without it.'
        )
    if tuning.ended != ALL_TRIALS:
        trials = counted(len(tuning.trials), 'trial')
        print(f'{tuning.ended} after {trials}: keeping the best of them')
    conclusion = report.conclusion(result, options.weights)
    if report.verdict(result, options.weights) == report.WORSE:
        LOGGER.warning(conclusion)
    else:
        print(conclusion)
