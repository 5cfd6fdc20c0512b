"""``rover-obstacles tune``: parameters learned from labelled bags."""

from __future__ import annotations

import argparse
import logging
import math
from pathlib import Path
from typing import TYPE_CHECKING

from rover_obstacle_detection.cli.arguments import (
    add_parameter_arguments,
    add_recording_arguments,
    calibration_files,
    detector_config,
    positive_int,
    positive_seconds,
)
from rover_obstacle_detection.cli.console import print_table, progress_bars, report_error
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.weights import Weights
from rover_obstacle_detection.tuning.space import (
    TUNED_BY_DEFAULT,
    Bounds,
    search_range,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rover_obstacle_detection.detection.config import DetectorConfig
    from rover_obstacle_detection.tuning.scenes import TuningScene
    from rover_obstacle_detection.tuning.tune import TuneOptions, TuningResult

DESCRIPTION = f"""\
Choose the detector's parameters by labelled bags, and see whether they hold on bags that had no
part in the choice (extra tune).

Held out are the bags named with --held-out; else, where some are called tune_* and others
report_*, the latter; else three in ten. What is written are all parameters as a ROS parameter
file, for the node and for --params.

tuned by default: {', '.join(TUNED_BY_DEFAULT)}
"""
EPILOG = """\
examples:
  rover-obstacles tune suite/* --output tuned.yaml
  rover-obstacles tune day1/ day2/ day3/ --folds 3 --output tuned.yaml --params rover.yaml
  rover-obstacles tune a/ b/ --held-out c/ -o tuned.yaml --parameter dark_grey_level \\
      --range dark_grey_level=10:80 --trials 20
  rover-obstacles replay traverse.mcap --params tuned.yaml --output result
"""
LOGGER = logging.getLogger(__name__)
MEMORY_MB = 2000
MANY_PROBLEMS = 3


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        'tune',
        help='choose parameters by labelled bags (extra tune)',
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        'bags', nargs='+', metavar='BAG', type=Path, help='labelled bag, as evaluate takes it'
    )
    _add_input_arguments(parser)
    _add_held_out_arguments(parser)
    _add_search_arguments(parser)
    add_parameter_arguments(parser.add_argument_group('parameters to start from'))
    output = parser.add_argument_group('output')
    output.add_argument(
        '-o', '--output', metavar='YAML', type=Path, required=True, help='parameter file to write'
    )
    output.add_argument(
        '--json', metavar='FILE', type=Path, help='write every trial and figure here'
    )
    output.add_argument('--force', action='store_true', help='replace files that exist')
    parser.set_defaults(run=run)


def _add_input_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('input')
    add_recording_arguments(group)
    group.add_argument(
        '--labels-topic',
        metavar='TOPIC',
        help='instances are looked for beside it (default: the one called truth/labels)',
    )
    group.add_argument(
        '--memory',
        metavar='MB',
        type=positive_int,
        default=MEMORY_MB,
        help='the frames are kept, 4 MB for 1024 x 768; refuse more than this (default: '
        f'{MEMORY_MB})',
    )


def _add_held_out_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('bags held out').add_mutually_exclusive_group()
    group.add_argument(
        '--held-out',
        nargs='+',
        action='extend',
        metavar='BAG',
        type=Path,
        default=[],
        help='bags not to tune on; they may be among the others, too',
    )
    group.add_argument(
        '--held-out-share',
        metavar='SHARE',
        type=_share,
        help='share of the bags, chosen by name and seed; 0: none (default: 0.3)',
    )
    group.add_argument(
        '--folds',
        metavar='N',
        type=_folds,
        help='tune on all bags, and N more times without one N-th of them, on which the figures '
        'are then made: takes N + 1 times as long, and is surer with few bags',
    )


def _add_search_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group('search')
    group.add_argument(
        '--parameter',
        metavar='NAME',
        type=_parameter,
        action='append',
        default=[],
        dest='parameters',
        help='tune this one, and not those by default; may be repeated',
    )
    group.add_argument(
        '--range',
        metavar='NAME=LOW:HIGH',
        type=_range,
        action='append',
        default=[],
        dest='ranges',
        help='values to try of a parameter; may be repeated',
    )
    group.add_argument(
        '--trials',
        metavar='N',
        type=positive_int,
        default=60,
        help='sets of parameters to try, the first of them that to start from (default: 60)',
    )
    group.add_argument(
        '--seconds', metavar='SECONDS', type=positive_seconds, help='begin no trial after this'
    )
    group.add_argument('--seed', metavar='N', type=_seed, default=0, help='(default: 0)')
    for name, meaning, default in (
        ('missed', 'all obstacles missed', Weights.missed),
        ('false-alarm', 'one false alarm in every frame', Weights.false_alarm),
    ):
        group.add_argument(
            f'--{name}-weight',
            metavar='WEIGHT',
            type=_weight,
            default=default,
            help=f'what {meaning} cost, in mean IoU (default: {default:g})',
        )


def _parameter(text: str) -> str:
    try:
        search_range(text)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def _range(text: str) -> tuple[str, Bounds]:
    name, _, bounds = text.partition('=')
    try:
        low, high = map(float, bounds.split(':'))
    except ValueError as error:
        msg = f'{text!r}: expected NAME=LOW:HIGH, such as dark_grey_level=10:80'
        raise argparse.ArgumentTypeError(msg) from error
    try:
        search_range(name, (low, high))
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return name, (low, high)


def _share(text: str) -> float:
    value = _number(text)
    if not 0 <= value < 1:
        msg = f'{text!r}: expected 0 or more, less than 1'
        raise argparse.ArgumentTypeError(msg)
    return value


def _weight(text: str) -> float:
    value = _number(text)
    if not 0 <= value < math.inf:
        msg = f'{text!r}: expected 0 or more'
        raise argparse.ArgumentTypeError(msg)
    return value


def _folds(text: str) -> int:
    value = positive_int(text)
    if value < 2:
        msg = f'{text!r}: expected 2 or more'
        raise argparse.ArgumentTypeError(msg)
    return value


def _seed(text: str) -> int:
    value = _number(text)
    if not 0 <= value < 2**32 or value != int(value):
        msg = f'{text!r}: expected a whole number, 0 or more'
        raise argparse.ArgumentTypeError(msg)
    return int(value)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def run(arguments: argparse.Namespace) -> int:
    """Tune, print what came of it, and write the parameter file."""
    from rover_obstacle_detection.offline.output_file import (
        check_output_file,
        write_json_whole,
        write_whole,
    )
    from rover_obstacle_detection.tuning.report import parameter_file, tuning_json
    from rover_obstacle_detection.tuning.sampler import tuning_library

    tuning_library()
    start = detector_config(argparse.Namespace(**{**vars(arguments), 'method': None}))
    options = _options(arguments, start)
    for path in (arguments.output, arguments.json):
        if path is not None:
            check_output_file(path, force=arguments.force)
    result = _result(arguments, start, options)
    _print_result(result, options)
    write_whole(arguments.output, parameter_file(result, options))
    print(f'parameters: {arguments.output}')
    if arguments.json:
        write_json_whole(arguments.json, tuning_json(result, options))
        print(f'trials and figures: {arguments.json}')
    return 0


def _options(arguments: argparse.Namespace, start: DetectorConfig) -> TuneOptions:
    from rover_obstacle_detection.tuning.space import ROVER_LIMITS, search_ranges
    from rover_obstacle_detection.tuning.tune import TuneOptions

    if start.method != 'hybrid' and not arguments.parameters:
        msg = f'the parameters tuned by default are of hybrid: name those of {start.method}'
        raise ConfigurationError(f'{msg} with --parameter')
    try:
        ranges = search_ranges(arguments.parameters, dict(arguments.ranges))
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    for each in ranges:
        if each.name in ROVER_LIMITS:
            LOGGER.warning(
                '%s is what the rover can do: labels cannot tell a better value',
                each.name,
            )
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
        calibration=calibration_files(arguments),
        every=arguments.every,
    )
    with progress_bars([path.name for path in paths], 'frames') as on_progress:
        scenes = read_scenes(paths, options, arguments.memory * MEGABYTE, on_progress)
    for scene in scenes:
        for line in scene.problems[:MANY_PROBLEMS]:
            report_error(line)
        if len(scene.problems) > MANY_PROBLEMS:
            report_error(f'{scene.path}: {len(scene.problems) - MANY_PROBLEMS} more like these')
    return scenes


def _print_result(result: TuningResult, options: TuneOptions) -> None:
    from rover_obstacle_detection.tuning.report import (
        WORSE,
        conclusion,
        parameter_table,
        scene_table,
        summary_table,
        verdict,
    )
    from rover_obstacle_detection.tuning.tune import ALL_TRIALS

    tuning = result.tuning
    tables = [scene_table(result.tuned, 'Tuned on')]
    if result.held_out is not None:
        tables.append(scene_table(result.held_out, f'Held out ({result.reason})'))
    tables += [summary_table(result, options.weights), parameter_table(tuning, options)]
    for table in tables:
        print_table(table)
    if result.folds:
        print(
            'The parameters are tuned on all bags. The figures of held-out bags are those of '
            'parameters tuned without them.'
        )
    if tuning.ended != ALL_TRIALS:
        print(f'{tuning.ended} after {len(tuning.trials)} trials: the best of these is kept')
    said = conclusion(result, options.weights)
    if verdict(result, options.weights) == WORSE:
        LOGGER.warning(said)
    else:
        print(said)
