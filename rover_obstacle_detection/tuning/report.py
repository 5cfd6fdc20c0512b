"""Results of a tuning: tables, a conclusion, a parameter file, and JSON content."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Sequence
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
from rover_obstacle_detection.tuning.space import range_text
from rover_obstacle_detection.tuning.tune import Comparison, TuneOptions, Tuning, TuningResult
from rover_obstacle_detection.wording import counted

BETTER = 'better'
WORSE = 'worse'
SAME = 'the same'
SCORE_TOLERANCE = 1e-6
"""Scores closer than this are the same: the difference is rounding."""
COMMENT_WIDTH = 100

_WHEN = ('before', 'tuned')


def verdict(result: TuningResult, weights: Weights) -> str:
    """Return `BETTER`, `WORSE` or `SAME` for the held-out scenes; empty without any."""
    return '' if result.held_out is None else _word(result.held_out.gain(weights))


def conclusion(result: TuningResult, weights: Weights) -> str:
    """Say in one sentence whether the tuned parameters are better."""
    if result.tuning.best is result.tuning.start:
        return 'No trial beat the initial parameters on the tuning bags: nothing changes.'
    held_out = result.held_out
    if held_out is None:
        return (
            'The tuned parameters are better on the tuning bags. Whether they are better on '
            f'others is unknown: no bags were held out ({result.reason}).'
        )
    words = [_word(gain) for gain in held_out.scene_gains(weights)]
    counts = ', '.join(f'{words.count(word)} {word}' for word in (BETTER, WORSE, SAME))
    before, after = (
        Terms.of(figures).score(weights) for figures in (held_out.before, held_out.after)
    )
    return (
        f'On the held-out bags the tuned parameters are {verdict(result, weights)}: score '
        f'{after:.3f}, was {before:.3f} ({counts}).'
    )


def parameter_table(tuning: Tuning, options: TuneOptions) -> Table:
    """Tabulate the tuned parameters, one per row."""
    before, after = vars(tuning.start.config), vars(tuning.best.config)
    rows = [
        (name, f'{before[name]:g}', f'{after[name]:g}', range_text(distribution))
        for name, distribution in options.ranges.items()
    ]
    return Table('Parameters', ('parameter', 'before', 'tuned', 'searched'), rows)


def summary_table(result: TuningResult, weights: Weights) -> Table:
    """Tabulate the pooled figures before and after tuning, of tuning and held-out scenes."""
    rows = []
    for name, comparison in (('tuned on', result.tuned), ('held out', result.held_out)):
        if comparison is None:
            continue
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
    """Tabulate the figures before and after tuning, one scene per row."""
    rows = []
    for name, *both in zip(comparison.scenes, comparison.before, comparison.after, strict=True):
        ious = (_number(each.iou if each.obstacle_pixels else None) for each in both)
        found = (f'{each.obstacles_found}/{each.obstacles}' for each in both)
        alarms = (_number(each.false_alarms_per_frame, 2) for each in both)
        rows.append((name, *ious, *found, *alarms))
    columns = (f'{what} {when}' for what in ('IoU', 'found', 'alarms') for when in _WHEN)
    return Table(title, ('bag', *columns), rows)


def parameter_file(result: TuningResult, options: TuneOptions) -> str:
    """Return the tuned parameters as a ROS parameter file, with their origin in comments."""
    tuning = result.tuning
    paragraphs = [
        f'rover_obstacle_detection {__version__}: parameters tuned by rover-obstacles tune, '
        f'{counted(len(tuning.trials), "trial")}, seed {options.seed}.',
        f'Tuned: {", ".join(options.ranges)}.',
        f'Tuned on: {", ".join(tuning.scenes)}.',
    ]
    if result.held_out is not None:
        paragraphs.append(f'Held out ({result.reason}): {", ".join(result.held_out.scenes)}.')
    paragraphs.append(conclusion(result, options.weights))
    wrapper = textwrap.TextWrapper(
        COMMENT_WIDTH, initial_indent='# ', subsequent_indent='#   ', break_long_words=False
    )
    comments = [line for paragraph in paragraphs for line in wrapper.wrap(paragraph)]
    return '\n'.join([*comments, dump_config(tuning.best.config)])


def tuning_json(result: TuningResult, options: TuneOptions) -> dict[str, Any]:
    """Return the settings, every trial and all figures, ready for JSON."""
    tuning, weights = result.tuning, options.weights
    held_out = result.held_out
    return {
        **preamble('tune', tuning.best.config),
        'parameters_before': dataclasses.asdict(tuning.start.config),
        'search': {
            'ranges': {name: [each.low, each.high] for name, each in options.ranges.items()},
            'weights': dataclasses.asdict(weights),
            'trials': options.trials,
            'seconds': options.seconds,
            'seed': options.seed,
            'ended': tuning.ended,
        },
        'tuned_on': _comparison_json(result.tuned, weights),
        'held_out': None if held_out is None else _comparison_json(held_out, weights),
        'held_out_reason': result.reason,
        'verdict': verdict(result, weights) or None,
        'conclusion': conclusion(result, weights),
        'trials': _trials_json(tuning, options),
        'folds': [
            {
                'tuned_on': list(fold.scenes),
                'ended': fold.ended,
                'trials': _trials_json(fold, options),
            }
            for fold in result.folds
        ],
    }


def _comparison_json(comparison: Comparison, weights: Weights) -> dict[str, Any]:
    return {
        'before': _pooled_json(comparison.before, weights),
        'tuned': _pooled_json(comparison.after, weights),
        'scenes': [
            {'scene': name, 'before': figures_json(before), 'tuned': figures_json(after)}
            for name, before, after in zip(
                comparison.scenes, comparison.before, comparison.after, strict=True
            )
        ],
    }


def _pooled_json(scenes: Sequence[Figures], weights: Weights) -> dict[str, Any]:
    terms = Terms.of(scenes)
    return {
        'scenes': len(scenes),
        'mean_iou': mean_scene_iou(scenes),
        'missed_share': terms.missed_share,
        'false_alarms_per_frame': terms.false_alarms,
        'score': terms.score(weights),
        'pooled': figures_json(total(scenes)),
    }


def _trials_json(tuning: Tuning, options: TuneOptions) -> list[dict[str, Any]]:
    return [
        {
            'parameters': {name: getattr(trial.config, name) for name in options.ranges},
            'score': trial.score,
            **dataclasses.asdict(Terms.of(trial.figures)),
            'seconds': round(trial.seconds, 3),
        }
        for trial in tuning.trials
    ]


def _word(gain: float) -> str:
    if abs(gain) < SCORE_TOLERANCE:
        return SAME
    return BETTER if gain > 0 else WORSE


def _number(value: float | None, digits: int = 3) -> str:
    return NONE if value is None else f'{value:.{digits}f}'
