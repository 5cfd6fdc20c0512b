"""The page that shows an evaluation to a reviewer."""

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

SVG = 'image/svg+xml'
LISTED_FAULTS = 5
MIN_LOSS = 0.01
LOSSES = {
    'missed': 'obstacles missed',
    'invented': 'false blobs',
    'too_wide': 'outlines {:.1f} px too wide',
    'too_narrow': 'outlines {:.1f} px too narrow',
}
DEFINITIONS = (
    'Precision, recall, F1 and IoU are over counted pixels: not the sky, not rocks within 20 % '
    'of the clearance. Mean IoU is the mean over scenes that have obstacles of the IoU pooled '
    "over a scene's frames; the other figures are pooled over all frames.",
    'An obstacle is a rock of at least 200 counted pixels, or a connected slope or drop area of '
    'at least 2,000; it is found when at least half of it is flagged. A false alarm is a '
    'connected flagged blob with at least 100 counted pixels and under a tenth of its pixels on '
    'obstacles or pixels that are not counted; the figure is per frame.',
    'Times are medians over the frames of a scene, then means over scenes; x SGBM is over one '
    'plain StereoSGBM call (3WAY, 64 disparities, block 5, P1 300, P2 1200) on the same pair in '
    'the same run. A dash is a ratio that is not defined.',
)
COLOURS = 'Green: hit. Blue: missed. Red: flagged, but free. Grey: not counted.'


def evaluation_html(evaluation: Evaluation, config: DetectorConfig) -> str:
    """Render the report.

    Raises
    ------
    MissingExtraError
        If Jinja2 or matplotlib is not installed.
    """
    scenes = {result.scene for result in evaluation.scenes}
    frames = sum(len(result.frames) for result in evaluation.of(evaluation.methods[0]))
    page = Page(
        title='Obstacle detection against labels',
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
        yield Section('Over the clearance', tuple(_curve_blocks(evaluation, config)))
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
        yield Section('Not used', tuple(map(TextBlock, evaluation.problems)))
    yield Section('What the figures mean', tuple(map(TextBlock, DEFINITIONS)))


def _times(evaluation: Evaluation) -> Block:
    means = [
        float(np.mean([result.times_plain for result in evaluation.of(method)]))
        for method in evaluation.methods
    ]
    svg = bar_plot(evaluation.methods, means, 'time over one plain SGBM call')
    return PictureBlock('Time of each method over plain SGBM on the same pair.', svg, SVG)


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
        'Precision against recall of pixels as max_step goes from 0.4 to 2 times its value '
        '(large dot: as configured). The labels stay those of the true clearance.',
        line_plot(recall_precision, 'recall', 'precision', y_limits=(0, 1.02)),
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
    # Where there is nothing to find, any overlap is 0 and says nothing.
    for name, caption in (
        ('iou', 'IoU'),
        ('recall', 'Recall of pixels'),
        ('obstacle_recall', 'Obstacles found'),
        ('precision', 'Precision of pixels'),
    ):
        lines = [
            Line(
                method,
                [float(place) for place in range(len(used))],
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
            lines, 'distance along the optical axis', caption, x_names=names, y_limits=(0, 1.02)
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
        'Separation is the chance that a pixel on an obstacle has the larger value: 0.5 tells '
        "nothing, 1 all. The thresholds are the study's T2 and T3."
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
                f'{name} of a window (m)',
            )
            yield PictureBlock(f'{method}: {name}; dashed: threshold.', svg, SVG)


def _shares(counts: NDArray[np.intp]) -> Sequence[float]:
    shares: list[float] = (counts / max(int(counts.sum()), 1))[1:-1].tolist()
    return shares


def _picture(picture: Picture) -> Block:
    caption = f'{picture.scene}, {picture.frame.stamp_ns / 1e9:.1f} s: {summary_of(picture)}'
    return PictureBlock(caption, picture.jpeg, 'image/jpeg')


def summary_of(picture: Picture) -> str:
    """Say in words what a picture shows, in one paragraph; see `summary_lines`."""
    return '. '.join(summary_lines(picture))


def summary_lines(picture: Picture) -> list[str]:
    """Say in words what a picture shows: IoU and what it lost, obstacles found, each fault."""
    frame = picture.frame
    figures = frame.figures
    if figures.obstacle_pixels:
        iou = 'no IoU' if figures.iou is None else f'IoU {figures.iou:.2f}'
        lost = '' if frame.losses is None else _losses(frame.losses)
        found = f'{figures.obstacles_found} of {figures.obstacles} obstacles found'
        first = f'{iou}{lost}, {found}'
    else:
        first = f'no obstacles there, {figures.false_positives} px flagged'
    faults = [str(fault) for fault in frame.faults[:LISTED_FAULTS]]
    rest = Counter(_sort(fault) for fault in frame.faults[LISTED_FAULTS:])
    more = [f'{count} more: {sort}' for sort, count in rest.most_common()]
    return [first, *frame.remarks, *faults, *more]


def _losses(losses: Losses) -> str:
    parts = [
        f'{100 * share:.0f} % to {words.format(losses.width_px(part) or 0.0)}'
        for part, words in LOSSES.items()
        if (share := losses.share(part)) is not None and share >= MIN_LOSS
    ]
    return f' (lost: {", ".join(parts)})' if parts else ''


def _sort(fault: Fault) -> str:
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
