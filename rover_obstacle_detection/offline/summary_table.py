"""Terminal tables of replays and of the obstacles in one pair."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import PurePath
from statistics import median
from typing import NamedTuple

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from rover_obstacle_detection.detection.rectification.correction import RECALIBRATE_PX
from rover_obstacle_detection.detection.result.obstacles import Obstacle
from rover_obstacle_detection.offline.stopwatch import StageTime
from rover_obstacle_detection.offline.summary import ReplaySummary
from rover_obstacle_detection.wording import counted

# Both fit a terminal of 80 columns.
_RECORDINGS_PER_TABLE = 3
_NAME_WIDTH = 12
_LISTED_BAD_FRAMES = 5


class _Row(NamedTuple):
    name: str
    value: str
    remark: str


def replay_table(summaries: Sequence[ReplaySummary]) -> RenderableType:
    """Tabulate replays, one per column, followed by damaged bags, bad frames and warnings."""
    if len(summaries) == 1:
        tables = [_table(summaries, with_remarks=True)]
    else:
        tables = [
            _table(summaries[start : start + _RECORDINGS_PER_TABLE], with_remarks=False)
            for start in range(0, len(summaries), _RECORDINGS_PER_TABLE)
        ]
    remarks = [line for summary in summaries for line in _remarks(summary)]
    return Group(*tables, *remarks)


def obstacle_table(obstacles: Sequence[Obstacle]) -> Table:
    """Tabulate obstacles from near to far."""
    # Headers on two lines and no outer frame: fits a terminal of 80 columns.
    table = Table(
        title=counted(len(obstacles), 'obstacle'),
        title_justify='left',
        show_edge=False,
        pad_edge=False,
    )
    for name in (
        '#',
        'kind',
        'range\nm',
        'height\nm',
        'width\nm',
        'depth\nm',
        'confi-\ndence',
        'pixels',
        'box\nx y w h',
    ):
        table.add_column(name, justify='left' if name == 'kind' else 'right')
    nearest_first = sorted(
        obstacles, key=lambda each: each.range_m if math.isfinite(each.range_m) else math.inf
    )
    for number, each in enumerate(nearest_first, start=1):
        table.add_row(
            str(number),
            each.kind,
            _metres(each.range_m),
            _metres(each.max_height_m),
            _metres(each.maximum_m[0] - each.minimum_m[0]),
            _metres(each.maximum_m[2] - each.minimum_m[2]),
            f'{each.confidence:.2f}',
            str(each.pixels),
            f'{each.left} {each.top} {each.width} {each.height}',
        )
    return table


def _table(summaries: Sequence[ReplaySummary], *, with_remarks: bool) -> Table:
    table = Table(title=f'Replay, method {summaries[0].config.method}', title_justify='left')
    table.add_column('', no_wrap=True)
    for summary in summaries:
        table.add_column(
            escape(PurePath(summary.bag).name),
            justify='right',
            overflow='fold',
            max_width=_NAME_WIDTH,
        )
    if with_remarks:
        table.add_column('', overflow='fold')
    for rows in _sections(summaries):
        for row, *others in rows:
            values = [row.value, *(other.value for other in others)]
            table.add_row(row.name, *values, *([escape(row.remark)] if with_remarks else []))
        table.add_section()
    return table


def _sections(summaries: Sequence[ReplaySummary]) -> Iterable[list[tuple[_Row, ...]]]:
    """Yield the rows of each section; each row has one entry per summary."""
    for section in (_counts, _times):
        yield list(zip(*(section(each) for each in summaries), strict=True))


def _counts(summary: ReplaySummary) -> list[_Row]:
    statistics = summary.statistics
    bad = len(summary.bad_frames)
    warned = sum(bool(each.warnings) for each in summary.frames)
    obstacles = [each.summary.obstacles for each in summary.frames]
    unmatched = f'{statistics.unmatched_left} left, {statistics.unmatched_right} right'
    if statistics.unmatched_left and statistics.smallest_gap_ns:
        unmatched += f'; smallest stamp gap {statistics.smallest_gap_ns / 1e6:.3f} ms'
    processed = f'{len(summary.frames)} processed'
    if summary.interrupted:
        processed = f'{len(summary.frames)} of about {summary.expected}, interrupted'
    return [
        _Row('left images', str(statistics.left), summary.topics.left_image),
        _Row('right images', str(statistics.right), summary.topics.right_image),
        _Row('pairs', str(statistics.pairs), processed),
        _Row('unmatched', str(statistics.unmatched_left + statistics.unmatched_right), unmatched),
        _Row('bad frames', str(bad), 'skipped, see below' if bad else ''),
        _Row('of these unjudgeable', str(summary.unjudgeable), ''),
        _Row('frames with warnings', str(warned), 'see below' if warned else ''),
        _Row(
            'obstacles per frame',
            f'{sum(obstacles) / len(obstacles):.1f}',
            f'{min(obstacles)} to {max(obstacles)}{_kinds(summary)}',
        ),
    ]


def _kinds(summary: ReplaySummary) -> str:
    """Count the obstacles of all frames by kind: ``; in all 12 rock, 1 slope``."""
    counts = Counter[str]()
    for each in summary.frames:
        counts.update(each.summary.obstacle_kinds)
    named = ', '.join(f'{count} {kind}' for kind, count in counts.most_common())
    return f'; in all {named}' if named else ''


def _times(summary: ReplaySummary) -> list[_Row]:
    stages = [_time(f'{stage}, ms per frame', time) for stage, time in summary.times.items()]
    return [*stages, _time('detector total, ms per frame', summary.detection_time)]


def _time(name: str, time: StageTime) -> _Row:
    return _Row(name, f'{time.mean_ms:.1f}', f'95th percentile {time.p95_ms:.1f}')


def _remarks(summary: ReplaySummary) -> Iterable[Text]:
    yield from (Text(note) for note in summary.notes)
    rows_px, lens_px = (
        median(getattr(each.summary, name) for each in summary.frames)
        for name in ('rows_off_px', 'lens_bend_px')
    )
    if max(rows_px, lens_px) >= RECALIBRATE_PX:
        yield Text(
            f'residual rectification error: rows off by {rows_px:.1f} px, lens distortion '
            f'{lens_px:.1f} px (medians). It is corrected, but costs accuracy: recalibrate, or '
            'correct the calibration with rover-obstacles inspect --write-calibration'
        )
    for bad in summary.bad_frames[:_LISTED_BAD_FRAMES]:
        yield Text(f'bad frame at {bad.stamp_ns / 1e9:.3f} s: {bad.reason}')
    more = len(summary.bad_frames) - _LISTED_BAD_FRAMES
    if more > 0:
        yield Text(f'and {counted(more, "more bad frame")}: see summary.json')
    for each in summary.warnings:
        yield Text(
            f'warning in {each.frames} of {counted(len(summary.frames), "frame")}, first at '
            f'{each.first_stamp_ns / 1e9:.3f} s: {each.text}'
        )


def _metres(value: float) -> str:
    return f'{value:.2f}' if math.isfinite(value) else '-'
