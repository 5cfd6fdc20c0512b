"""The HTML report of an evaluation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection import __version__
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.evaluation.distributions import EDGES_M
from rover_obstacle_detection.evaluation.faults import Fault
from rover_obstacle_detection.evaluation.losses import Losses
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.evaluation.ranges import span_names
from rover_obstacle_detection.evaluation.results import Evaluation, Picture
from rover_obstacle_detection.evaluation.tables import (
    Table,
    condition_ious,
    condition_obstacles,
    condition_table,
    distribution_table,
    method_table,
    range_table,
    scene_table,
)
from rover_obstacle_detection.report.page import (
    Block,
    Page,
    PictureBlock,
    Section,
    TableBlock,
    TextBlock,
    render_page,
)
from rover_obstacle_detection.report.plots import Line, bar_plot, distribution_plot, line_plot
from rover_obstacle_detection.wording import counted

SVG = 'image/svg+xml'
LISTED_FAULTS = 5
MIN_LOSS = 0.01  # smaller losses of IoU are not listed
RATIO_LIMITS = (0, 1.02)  # of an axis, so that markers at 1 are drawn in full
LOSSES = {
    'missed': 'obstacles missed',
    'invented': 'false blobs',
    'too_wide': 'outlines {:.1f} px too wide',
    'too_narrow': 'outlines {:.1f} px too narrow',
}
DEFINITIONS = (
    'Precision, recall, F1 and IoU are computed over counted pixels. The sky and rocks within '
    '20 % of the clearance are not counted. IoU is pooled over the frames of a scene; mean IoU '
    'is its mean over the scenes with obstacles. All other figures are pooled over all frames.',
    'An obstacle is a rock of at least 200 counted pixels, or a connected slope or drop of at '
    'least 2,000. It is found if at least half of it is flagged. A false alarm is a connected '
    'flagged blob of at least 100 counted pixels, of which less than a tenth lies on obstacles '
    'or uncounted pixels. False alarms are given per frame.',
    'Found: obstacles found out of all. Called free: share of the obstacle pixels that a method '
    'reports as known and does not flag; a dash for methods that do not report what is known.',
    'Times are medians over the frames of a scene, averaged over scenes. x SGBM is the ratio to '
    'one plain StereoSGBM call (3WAY, 64 disparities, block 5, P1 300, P2 1200) on the same pair '
    'in the same run. A dash marks an undefined ratio.',
)
COLOURS = 'Green: hit. Blue: missed. Red: false alarm. Grey: not counted.'


def evaluation_html(evaluation: Evaluation, config: DetectorConfig) -> str:
    """Render the report as a self-contained HTML page.

    Raises
    ------
    MissingExtraError
        If Jinja2 or matplotlib is not installed.
    """
    scenes = {result.scene for result in evaluation.scenes}
    frames = sum(len(result.frames) for result in evaluation.of(evaluation.methods[0]))
    page = Page(
        title='Evaluation against labels',
        lead=(
            f'Scenes: {len(scenes)}. Frames: {frames}. Methods: {len(evaluation.methods)}. '
            f'Conditions: {", ".join(evaluation.conditions)}. {_parameters(config)}',
        ),
        sections=tuple(_sections(evaluation, config)),
        foot=f'rover_obstacle_detection {__version__}',
    )
    return render_page(page)


def _sections(evaluation: Evaluation, config: DetectorConfig) -> Iterator[Section]:
    first = evaluation.methods[0]
    methods = '; '.join(f'{name}: {METHOD_DESCRIPTIONS[name]}' for name in evaluation.methods)
    yield Section(
        'All scenes', (_table(method_table(evaluation)), _times(evaluation), TextBlock(methods))
    )
    yield Section(
        'By condition',
        tuple(
            _table(table)
            for table in (
                condition_table(evaluation, first),
                condition_ious(evaluation),
                condition_obstacles(evaluation),
            )
        ),
    )
    if evaluation.curves:
        yield Section('By clearance', tuple(_curve_blocks(evaluation, config)))
    if evaluation.by_range(first):
        yield Section('By distance', tuple(_range_blocks(evaluation)))
    if evaluation.distributions:
        yield Section('Roughness and elevation step', tuple(_terrain(evaluation, config)))
    for method in evaluation.methods:
        worst = [picture for picture in evaluation.pictures if picture.method == method]
        if worst:
            pictures = (TextBlock(COLOURS), *map(_picture, worst))
            yield Section(f'Worst frames of {method}', pictures, is_folded=method != first)
    scenes = tuple(_table(scene_table(evaluation, method)) for method in evaluation.methods)
    yield Section('By scene', scenes, is_folded=True)
    if evaluation.problems:
        yield Section('Skipped', tuple(map(TextBlock, evaluation.problems)))
    yield Section('Definitions', tuple(map(TextBlock, DEFINITIONS)))


def _times(evaluation: Evaluation) -> Block:
    means = [
        float(np.mean([result.times_plain for result in evaluation.of(method)]))
        for method in evaluation.methods
    ]
    svg = bar_plot(evaluation.methods, means, 'time / plain SGBM time')
    return PictureBlock('Time relative to plain SGBM on the same pair.', svg, SVG)


def _curve_blocks(evaluation: Evaluation, config: DetectorConfig) -> Iterator[Block]:
    recall_precision, ious = [], []
    for method, curve in evaluation.curves.items():
        clearances = sorted(curve)
        figures = [curve[clearance] for clearance in clearances]
        configured = round(config.max_step, 4)
        marked = clearances.index(configured) if configured in clearances else None
        precisions = [each.precision for each in figures]
        recalls = [each.recall for each in figures]
        colour = evaluation.methods.index(method)
        recall_precision.append(Line(method, recalls, precisions, colour, marked))
        ious.append(Line(method, clearances, [each.iou for each in figures], colour, marked))
    yield PictureBlock(
        'Pixel precision against recall for max_step from 0.4 to 2 times the configured value '
        '(large dot). The labels do not change.',
        line_plot(recall_precision, 'recall', 'precision', y_limits=RATIO_LIMITS),
        SVG,
    )
    yield PictureBlock('Pooled IoU against max_step.', line_plot(ious, 'max_step (m)', 'IoU'), SVG)


def _range_blocks(evaluation: Evaluation) -> Iterator[Block]:
    used = [
        index
        for index in range(len(span_names()))
        if evaluation.by_range(evaluation.methods[0])[index].frames
    ]
    names = [span_names()[index] for index in used]
    for name, caption in (
        ('iou', 'IoU'),
        ('recall', 'Pixel recall'),
        ('obstacle_recall', 'Obstacles found'),
        ('precision', 'Pixel precision'),
    ):
        lines = [
            Line(
                method,
                [float(place) for place in range(len(used))],
                # Without obstacles these ratios are 0 or undefined and mean nothing.
                [
                    getattr(spans[index], name) if spans[index].obstacle_pixels else None
                    for index in used
                ],
                colour,
            )
            for colour, method in enumerate(evaluation.methods)
            if (spans := evaluation.by_range(method))
        ]
        svg = line_plot(
            lines, 'distance along the optical axis', caption, x_names=names, y_limits=RATIO_LIMITS
        )
        yield PictureBlock(f'{caption} by distance.', svg, SVG)
    table = range_table(evaluation, evaluation.methods[0])
    if table is not None:
        yield _table(table)


def _terrain(evaluation: Evaluation, config: DetectorConfig) -> Iterator[Block]:
    table = distribution_table(evaluation, config.study_max_roughness, config.study_max_step)
    if table is not None:
        yield _table(table)
    yield TextBlock(
        'Separation is the probability that an obstacle pixel has a larger value than a free one: '
        "0.5 is chance, 1 perfect. The thresholds are the study's T2 and T3."
    )
    for method, both in evaluation.distributions.items():
        for name, distribution, threshold_m in (
            ('roughness', both.roughness, config.study_max_roughness),
            ('elevation step', both.step, config.study_max_step),
        ):
            svg = distribution_plot(
                EDGES_M[1:-1].tolist(),
                [
                    ('free ground', _shares(distribution.free)),
                    ('obstacles', _shares(distribution.obstacle)),
                ],
                threshold_m,
                f'{name} per window (m)',
            )
            yield PictureBlock(f'{method}: {name}. Dashed: threshold.', svg, SVG)


def _shares(counts: NDArray[np.intp]) -> Sequence[float]:
    shares: list[float] = (counts / max(int(counts.sum()), 1))[1:-1].tolist()
    return shares


def _picture(picture: Picture) -> Block:
    caption = f'{picture.scene}, {picture.frame.stamp_ns / 1e9:.1f} s: {summary_of(picture)}'
    return PictureBlock(caption, picture.jpeg, 'image/jpeg')


def summary_of(picture: Picture) -> str:
    """Describe a picture in one paragraph; see `summary_lines`."""
    return '. '.join(summary_lines(picture))


def summary_lines(picture: Picture) -> list[str]:
    """Describe a picture: IoU and its losses, obstacles found, and each fault."""
    frame = picture.frame
    figures = frame.figures
    if figures.obstacle_pixels:
        iou = 'no IoU' if figures.iou is None else f'IoU {figures.iou:.2f}'
        lost = '' if frame.losses is None else _losses(frame.losses)
        found = f'{figures.obstacles_found} of {counted(figures.obstacles, "obstacle")} found'
        first = f'{iou}{lost}, {found}'
    else:
        first = f'no obstacles, {figures.false_positives} px flagged'
    faults = [str(fault) for fault in frame.faults[:LISTED_FAULTS]]
    rest = Counter(_fault_kind(fault) for fault in frame.faults[LISTED_FAULTS:])
    more = [f'{count} more: {kind}' for kind, count in rest.most_common()]
    return [first, *frame.remarks, *faults, *more]


def _losses(losses: Losses) -> str:
    parts = [
        f'{100 * share:.0f} % to {words.format(losses.width_px(part) or 0.0)}'
        for part, words in LOSSES.items()
        if (share := losses.share(part)) is not None and share >= MIN_LOSS
    ]
    return f' (lost: {", ".join(parts)})' if parts else ''


def _fault_kind(fault: Fault) -> str:
    return fault.kind if fault.cause is None else f'{fault.kind}, {fault.cause.name}'


def _table(table: Table) -> Block:
    return TableBlock(table.title, table.header, table.rows)


def _parameters(config: DetectorConfig) -> str:
    changed = [
        f'{each.name} {getattr(config, each.name)}'
        for each in config.parameters()
        if each.name != 'method' and getattr(config, each.name) != each.default
    ]
    return f'Parameters: {", ".join(changed)}.' if changed else 'Default parameters.'
