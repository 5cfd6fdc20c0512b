"""What a tuning came to: tables, one sentence, a parameter file, and plain mappings for JSON."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

from rover_obstacle_detection import __version__
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.objective import Terms
from rover_obstacle_detection.evaluation.results import mean_scene_iou, total
from rover_obstacle_detection.evaluation.tables import NONE, Table
from rover_obstacle_detection.evaluation.weights import Weights
from rover_obstacle_detection.offline.evaluation_json import figures_json
from rover_obstacle_detection.offline.summary import preamble
from rover_obstacle_detection.parameter_file import dump_config
from rover_obstacle_detection.tuning.tune import Comparison, TuneOptions, Tuning, TuningResult

BETTER = 'better'
WORSE = 'worse'
SAME = 'the same'
SMALLEST_DIFFERENCE = 1e-6
WIDTH = 100


def verdict(result: TuningResult, weights: Weights) -> str:
    """Tell how the tuned parameters do on held-out scenes: better, worse, the same, or ''."""
    return '' if result.held_out is None else _word(result.held_out.gain(weights))


def conclusion(result: TuningResult, weights: Weights) -> str:
    """Say in plain words whether the tuned parameters are better, and where that is known."""
    if result.tuning.best is result.tuning.start:
        return (
            'No other parameters scored higher on the bags tuned on: they are left as they were.'
        )
    held_out = result.held_out
    if held_out is None:
        return (
            f'Nothing was held out ({result.reason}): the tuned parameters are better on the bags '
            'that they were tuned on, and whether they are on others is not known.'
        )
    words = [_word(gain) for gain in held_out.scene_gains(weights)]
    before, after = (
        Terms.of(figures).score(weights) for figures in (held_out.before, held_out.after)
    )
    sides = ', '.join(f'{words.count(word)} {word}' for word in (BETTER, WORSE, SAME))
    return (
        f'On the held-out bags the tuned parameters are {verdict(result, weights)}: score '
        f'{after:.3f}, before {before:.3f}; by bag {sides}.'
    )


def parameter_table(tuning: Tuning, options: TuneOptions) -> Table:
    """Tabulate what was tuned, a row a parameter."""
    rows = [
        (
            each.name,
            f'{getattr(tuning.start.config, each.name):g}',
            f'{getattr(tuning.best.config, each.name):g}',
            str(each),
        )
        for each in options.ranges
    ]
    return Table('Parameters', ('parameter', 'before', 'tuned', 'searched'), rows)


def summary_table(result: TuningResult, weights: Weights) -> Table:
    """Before and after, on the scenes tuned on and on those held out."""
    rows = []
    for name, comparison in _comparisons(result):
        for when, figures in (('before', comparison.before), ('tuned', comparison.after)):
            pooled = total(figures)
            terms = Terms.of(figures)
            rows.append(
                (
                    f'{name}, {when}',
                    str(len(figures)),
                    str(pooled.frames),
                    _number(mean_scene_iou(figures)),
                    f'{pooled.obstacles_found}/{pooled.obstacles}',
                    f'{terms.false_alarms:.2f}',
                    f'{terms.score(weights):.3f}',
                )
            )
    header = ('bags', 'scenes', 'frames', 'mean IoU', 'obstacles', 'false alarms', 'score')
    return Table('Before and after', header, rows)


def scene_table(comparison: Comparison, title: str) -> Table:
    """Before and after, a row a scene."""
    rows = [
        (
            name,
            _number(before.iou if before.obstacle_pixels else None),
            _number(after.iou if after.obstacle_pixels else None),
            f'{before.obstacles_found}/{before.obstacles}',
            f'{after.obstacles_found}/{after.obstacles}',
            _number(before.false_alarms_per_frame, 2),
            _number(after.false_alarms_per_frame, 2),
        )
        for name, before, after in zip(
            comparison.scenes, comparison.before, comparison.after, strict=True
        )
    ]
    header = (
        'bag',
        'IoU before',
        'IoU tuned',
        'found before',
        'found tuned',
        'alarms before',
        'alarms tuned',
    )
    return Table(title, header, rows)


def parameter_file(result: TuningResult, options: TuneOptions) -> str:
    """Write the tuned parameters as a ROS parameter file that says where they come from."""
    tuning = result.tuning
    paragraphs = [
        f'rover_obstacle_detection {__version__}: parameters tuned by rover-obstacles tune, '
        f'{len(tuning.trials)} trials, seed {options.seed}.',
        f'Tuned: {", ".join(each.name for each in options.ranges)}.',
        f'Tuned on: {", ".join(tuning.scenes)}.',
    ]
    if result.held_out is not None:
        paragraphs.append(f'Held out ({result.reason}): {", ".join(result.held_out.scenes)}.')
    paragraphs.append(conclusion(result, options.weights))
    comment = ''.join(
        textwrap.fill(
            each, WIDTH, initial_indent='# ', subsequent_indent='#   ', break_long_words=False
        )
        + '\n'
        for each in paragraphs
    )
    return comment + dump_config(tuning.best.config)


def tuning_json(result: TuningResult, options: TuneOptions) -> dict[str, Any]:
    """Return everything that was tried and found."""
    tuning, weights = result.tuning, options.weights
    return {
        **preamble('tune', tuning.best.config),
        'parameters_before': dataclasses.asdict(tuning.start.config),
        'search': {
            'ranges': {each.name: [each.low, each.high] for each in options.ranges},
            'weights': dataclasses.asdict(weights),
            'trials': options.trials,
            'seconds': options.seconds,
            'seed': options.seed,
            'ended': tuning.ended,
        },
        'tuned_on': _comparison_json(result.tuned, weights),
        'held_out': None
        if result.held_out is None
        else _comparison_json(result.held_out, weights),
        'held_out_reason': result.reason,
        'verdict': verdict(result, weights) or None,
        'conclusion': conclusion(result, weights),
        'trials': list(_trials_json(tuning, options)),
        'folds': [
            {
                'tuned_on': list(fold.scenes),
                'ended': fold.ended,
                'trials': list(_trials_json(fold, options)),
            }
            for fold in result.folds
        ],
    }


def _comparisons(result: TuningResult) -> Iterator[tuple[str, Comparison]]:
    yield 'tuned on', result.tuned
    if result.held_out is not None:
        yield 'held out', result.held_out


def _comparison_json(comparison: Comparison, weights: Weights) -> dict[str, Any]:
    return {
        'before': _group(comparison.before, weights),
        'tuned': _group(comparison.after, weights),
        'scenes': [
            {'scene': name, 'before': figures_json(before), 'tuned': figures_json(after)}
            for name, before, after in zip(
                comparison.scenes, comparison.before, comparison.after, strict=True
            )
        ],
    }


def _group(scenes: Sequence[Figures], weights: Weights) -> dict[str, Any]:
    terms = Terms.of(scenes)
    return {
        'scenes': len(scenes),
        'mean_iou': mean_scene_iou(scenes),
        'missed_share': terms.missed_share,
        'false_alarms_per_frame': terms.false_alarms,
        'score': terms.score(weights),
        'pooled': figures_json(total(scenes)),
    }


def _trials_json(tuning: Tuning, options: TuneOptions) -> Iterator[dict[str, Any]]:
    for trial in tuning.trials:
        yield {
            'parameters': {each.name: getattr(trial.config, each.name) for each in options.ranges},
            'score': trial.score,
            **dataclasses.asdict(Terms.of(trial.figures)),
            'seconds': round(trial.seconds, 3),
        }


def _word(gain: float) -> str:
    if abs(gain) < SMALLEST_DIFFERENCE:
        return SAME
    return BETTER if gain > 0 else WORSE


def _number(value: float | None, digits: int = 3) -> str:
    return NONE if value is None else f'{value:.{digits}f}'
