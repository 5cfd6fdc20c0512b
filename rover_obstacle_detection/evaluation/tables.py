"""Tables of an evaluation as text, for the terminal, reports and documentation."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from rover_obstacle_detection.evaluation.distributions import Distribution
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.ranges import span_names
from rover_obstacle_detection.evaluation.results import (
    Evaluation,
    SceneResult,
    mean_iou,
    total,
    worst_condition,
)

NONE = '-'
TIME_HEADER = ('ms', 'x SGBM')
FIGURE_HEADER = (
    'mean IoU',
    'precision',
    'recall',
    'F1',
    'found',
    'false alarms',
    'called free',
)


@dataclass(frozen=True)
class Table:
    """Rows of text under a header."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def as_markdown(self) -> str:
        """Format a table with rows as Markdown, without the title; numbers are right-aligned."""
        columns = zip(*self.rows, strict=True)
        rule = ['---' if any(map(_is_text, cells)) else '---:' for cells in columns]
        lines = (self.header, ['---', *rule[1:]], *self.rows)
        return '\n'.join(f'| {" | ".join(cells)} |' for cells in lines) + '\n'


def method_table(evaluation: Evaluation, *, with_times: bool = True) -> Table:
    """Tabulate all scenes together, one row per method."""
    rows = []
    for method in evaluation.methods:
        results = evaluation.of(method)
        worst = worst_condition(evaluation, method)
        times = (
            f'{1000 * statistics.fmean(each.median_seconds for each in results):.0f}',
            f'{statistics.fmean(each.times_plain for each in results):.2f}',
        )
        rows.append(
            (
                method,
                *_figures(results),
                number(None if worst is None else worst[1]),
                *(times if with_times else ()),
            )
        )
    header = ('method', *FIGURE_HEADER, 'worst IoU', *(TIME_HEADER if with_times else ()))
    return Table('All scenes', header, rows)


def condition_table(evaluation: Evaluation, method: str) -> Table:
    """Tabulate one method, one row per condition."""
    rows = []
    for condition in evaluation.conditions:
        results = evaluation.of(method, condition)
        rows.append((condition, str(len(results)), *_figures(results)))
    return Table(f'{method} by condition', ('condition', 'scenes', *FIGURE_HEADER), rows)


def condition_ious(evaluation: Evaluation) -> Table:
    """Tabulate mean IoU, one row per condition and one column per method."""
    rows = [
        (
            condition,
            *(number(mean_iou(evaluation.of(method, condition))) for method in evaluation.methods),
        )
        for condition in evaluation.conditions
    ]
    return Table('Mean IoU by condition', ('condition', *evaluation.methods), rows)


def condition_obstacles(evaluation: Evaluation) -> Table:
    """Tabulate obstacles found and false alarms per frame, like `condition_ious`."""
    rows = [
        (
            condition,
            *(
                _found_and_alarms(evaluation.of(method, condition))
                for method in evaluation.methods
            ),
        )
        for condition in evaluation.conditions
    ]
    title = 'Obstacles found, and false alarms per frame, by condition'
    return Table(title, ('condition', *evaluation.methods), rows)


def scene_table(evaluation: Evaluation, method: str, *, with_times: bool = True) -> Table:
    """Tabulate one method, one row per scene."""
    rows = []
    for result in evaluation.of(method):
        times = (f'{1000 * result.median_seconds:.0f}', f'{result.times_plain:.2f}')
        figures = (result.scene, str(len(result.frames)), *_figures([result]))
        rows.append((*figures, *times) if with_times else figures)
    header: tuple[str, ...] = ('scene', 'frames', 'IoU', *FIGURE_HEADER[1:])
    header = (*header, *TIME_HEADER) if with_times else header
    return Table(f'{method} by scene', header, rows)


def range_table(evaluation: Evaluation, method: str) -> Table | None:
    """Tabulate one method, one row per distance; None without depth."""
    rows = [
        (
            name,
            number(figures.iou),
            number(figures.precision),
            number(figures.recall),
            found_of(figures),
            str(figures.false_alarms),
            percent(figures.called_free_share, 1),
        )
        for name, figures in zip(span_names(), evaluation.by_range(method), strict=False)
        if figures.frames
    ]
    header = (
        'distance',
        'IoU',
        'precision',
        'recall',
        'found',
        'false alarms',
        'called free',
    )
    return Table(f'{method} by distance', header, rows) if rows else None


def distribution_table(
    evaluation: Evaluation, max_roughness_m: float, max_step_m: float
) -> Table | None:
    """Tabulate roughness and step on free ground and obstacles; None if not measured."""
    rows = []
    for method, both in evaluation.distributions.items():
        for name, distribution, threshold_m in (
            ('roughness', both.roughness, max_roughness_m),
            ('step', both.step, max_step_m),
        ):
            over_free, over_obstacle = distribution.share_over(threshold_m)
            rows.append(
                (
                    f'{method}: {name}',
                    _spread_mm(distribution, on_obstacles=False),
                    _spread_mm(distribution, on_obstacles=True),
                    number(distribution.separation),
                    f'{1000 * threshold_m:g} mm',
                    percent(over_free),
                    percent(over_obstacle),
                )
            )
    header = (
        'measure',
        'free ground 10/50/90 % (mm)',
        'obstacles 10/50/90 % (mm)',
        'separation',
        'threshold',
        'free above it',
        'obstacles above it',
    )
    return Table('Terrain measures of a window', header, rows) if rows else None


def number(value: float | None, digits: int = 3) -> str:
    """Format a number; a dash for None."""
    return NONE if value is None else f'{value:.{digits}f}'


def percent(value: float | None, digits: int = 0) -> str:
    """Format a share in percent; a dash for None."""
    return NONE if value is None else f'{100 * value:.{digits}f} %'


def found_of(figures: Figures) -> str:
    """Format obstacles found out of all, as in ``3/4``."""
    return f'{figures.obstacles_found}/{figures.obstacles}'


def _is_text(cell: str) -> bool:
    return cell[:1].isalpha()


def _figures(results: Sequence[SceneResult]) -> tuple[str, ...]:
    pooled = total(result.figures for result in results)
    return (
        number(mean_iou(results)),
        number(pooled.precision),
        number(pooled.recall),
        number(pooled.f1),
        found_of(pooled),
        number(pooled.false_alarms_per_frame, 2),
        percent(pooled.called_free_share, 1),
    )


def _found_and_alarms(results: Sequence[SceneResult]) -> str:
    pooled = total(result.figures for result in results)
    return f'{found_of(pooled)}, {number(pooled.false_alarms_per_frame, 1)}'


def _spread_mm(distribution: Distribution, *, on_obstacles: bool) -> str:
    counts = distribution.obstacle if on_obstacles else distribution.free
    values = [distribution.quantile(counts, share) for share in (0.1, 0.5, 0.9)]
    return ' / '.join(NONE if value is None else _millimetres(value) for value in values)


def _millimetres(value_m: float) -> str:
    return f'{1000 * value_m:.{0 if value_m >= 0.01 else 2}f}'
