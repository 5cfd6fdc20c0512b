"""Tables of faults, of IoU losses and of the ablation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from rover_obstacle_detection.evaluation.faults import Fault
from rover_obstacle_detection.evaluation.losses import Losses
from rover_obstacle_detection.evaluation.results import (
    Evaluation,
    SceneResult,
    mean_iou,
    total,
    worst_condition,
)
from rover_obstacle_detection.evaluation.tables import NONE, Table, found_of, number

LOSS_HEADER = {
    'missed': 'obstacles missed',
    'invented': 'false blobs',
    'too_wide': 'outlines too wide',
    'too_narrow': 'outlines too narrow',
}


def count_faults(results: Sequence[SceneResult]) -> Counter[tuple[str, str]]:
    """Count faults by kind and name of the cause."""
    return Counter(map(_sort, _faults(results)))


def causes_table(evaluation: Evaluation, method: str) -> Table:
    """Count the faults of a method by kind and cause, most frequent first."""
    results = evaluation.of(method)
    pixels: Counter[tuple[str, str]] = Counter()
    for fault in _faults(results):
        pixels[_sort(fault)] += fault.pixels
    rows = [
        (kind, cause, str(count), str(pixels[kind, cause]))
        for (kind, cause), count in count_faults(results).most_common()
    ]
    return Table(f'Faults of {method}', ('fault', 'most likely cause', 'number', 'pixels'), rows)


def losses_table(evaluation: Evaluation, method: str) -> Table:
    """Tabulate what lowers the IoU of each scene with obstacles."""
    rows = []
    for result in evaluation.of(method):
        losses = sum((frame.losses or Losses() for frame in result.frames), Losses())
        iou = losses.share('hit') if result.figures.obstacle_pixels else None
        if iou is None:
            continue
        cells = [_part(losses, part) for part in LOSS_HEADER]
        rows.append((result.scene, f'{iou:.3f}', *cells))
    return Table(f'Losses of {method}', ('scene', 'IoU', *LOSS_HEADER.values()), rows)


def ablation_table(evaluation: Evaluation, whole: str) -> Table:
    """Compare a method with variants of it that lack a stage."""
    of_whole = mean_iou(evaluation.of(whole))
    rows = []
    for method in evaluation.methods:
        results = evaluation.of(method)
        own = mean_iou(results)
        figures = total(result.figures for result in results)
        worst = worst_condition(evaluation, method)
        rows.append(
            (
                method,
                number(own),
                NONE if own is None or of_whole is None else f'{own - of_whole:+.3f}',
                found_of(figures),
                number(figures.false_alarms_per_frame, 2),
                NONE if worst is None else f'{worst[0]}: {worst[1]:.3f}',
            )
        )
    header = ('method', 'mean IoU', 'difference', 'obstacles', 'false alarms', 'worst condition')
    return Table('Stages left out', header, rows)


def _faults(results: Sequence[SceneResult]) -> Iterator[Fault]:
    return (fault for result in results for frame in result.frames for fault in frame.faults)


def _sort(fault: Fault) -> tuple[str, str]:
    return fault.kind, NONE if fault.cause is None else fault.cause.name


def _part(losses: Losses, part: str) -> str:
    share = losses.share(part) or 0.0
    width_px = losses.width_px(part) if part.startswith('too_') else None
    return f'{share:.3f}' if width_px is None else f'{share:.3f} ({width_px:.1f} px)'
