"""The short tables of docs/evaluation.md."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

from rover_obstacle_detection.evaluation.results import (
    Evaluation,
    SceneResult,
    mean_iou,
    total,
)
from rover_obstacle_detection.evaluation.tables import Table, found_of, number, percent
from studies.fault_tables import count_faults

FIGURES = (
    'mean IoU',
    'worst IoU',
    'obstacles found',
    'false alarms per frame',
    'obstacle pixels called free',
    'free pixels called free',
)

# Stages that change mean IoU by less than this are left to the full ablation table.
MIN_DIFFERENCE = 0.02

# Less frequent faults are left to the full tables of causes.
MAX_FAILURES = 5

Suites = Mapping[str, Sequence[SceneResult]]


def summary_table(evaluation: Evaluation) -> Table:
    """Tabulate all scenes together, one row per method."""
    rows = []
    for method in evaluation.methods:
        results = evaluation.of(method)
        seconds = statistics.fmean(each.median_seconds for each in results)
        ratio = statistics.fmean(each.times_plain for each in results)
        rows.append((method, *_figures(results), f'{1000 * seconds:.0f}', f'{ratio:.1f}'))
    return Table('Methods', ('method', *FIGURES, 'ms', 'x SGBM'), rows)


def suites_table(suites: Suites) -> Table:
    """Tabulate one method, one row per suite."""
    rows = [
        (name, str(len(results)), *_figures(results))
        for name, results in suites.items()
        if results
    ]
    return Table('Suites', ('suite', 'scenes', *FIGURES), rows)


def stages_table(evaluations: Mapping[str, Evaluation], whole: str) -> Table:
    """Tabulate the change of mean IoU without each stage that matters, by suite.

    Parameters
    ----------
    evaluations : mapping of str to Evaluation
        The whole method and the method without each stage, by suite.
    whole : str
        Name of the whole method.
    """
    differences = {
        name: _differences(evaluation, whole) for name, evaluation in evaluations.items()
    }
    stages = dict.fromkeys(stage for each in differences.values() for stage in each)
    by_stage = {stage: [each.get(stage, 0.0) for each in differences.values()] for stage in stages}
    rows = [
        (stage, *(f'{value:+.3f}' for value in values))
        for stage, values in sorted(by_stage.items(), key=lambda item: min(item[1]))
        if max(map(abs, values)) >= MIN_DIFFERENCE
    ]
    return Table('Stages', ('stage left out', *evaluations), rows)


def failures_table(suites: Suites) -> Table:
    """Count the most frequent faults of one method by kind and cause, one column per suite."""
    counts = {name: count_faults(results) for name, results in suites.items()}
    everywhere = sum(counts.values(), count_faults([]))
    rows = [
        (kind, cause, *(str(each[kind, cause]) for each in counts.values()))
        for (kind, cause), _ in everywhere.most_common(MAX_FAILURES)
    ]
    return Table('Failures', ('fault', 'most likely cause', *suites), rows)


def _differences(evaluation: Evaluation, whole: str) -> dict[str, float]:
    of_whole = mean_iou(evaluation.of(whole))
    differences = {}
    for method in evaluation.methods:
        iou = mean_iou(evaluation.of(method))
        if method != whole and iou is not None and of_whole is not None:
            differences[method.removeprefix(f'{whole} without ')] = iou - of_whole
    return differences


def _figures(results: Sequence[SceneResult]) -> tuple[str, ...]:
    pooled = total(result.figures for result in results)
    ious = [mean_iou([result]) for result in results]
    return (
        number(mean_iou(results)),
        number(min((iou for iou in ious if iou is not None), default=None)),
        found_of(pooled),
        number(pooled.false_alarms_per_frame, 2),
        percent(pooled.called_free_share, 1),
        percent(pooled.confirmed_free_share, 1),
    )
