"""The table at the end of a replay."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from rover_obstacle_detection.detection.obstacles import Obstacle
from rover_obstacle_detection.stopwatch import StageTime, stage_times
from rover_obstacle_detection.summary import ReplaySummary

_LISTED_REASONS = 5


def replay_table(summaries: Sequence[ReplaySummary]) -> RenderableType:
    """Tabulate one replay from top to bottom, several a row each; bad frames beneath."""
    table = _table_of_one(summaries[0]) if len(summaries) == 1 else _table_of_many(summaries)
    reasons = [line for summary in summaries for line in _bad_frames(summary)]
    return Group(table, *reasons)


def obstacle_table(obstacles: Sequence[Obstacle]) -> Table:
    """Tabulate single obstacles, the nearest first."""
    table = Table(title='Obstacles', title_justify='left')
    for name in ('#', 'range m', 'height m', 'width m', 'depth m', 'pixels', 'box x y w h'):
        table.add_column(name, justify='right')
    nearest_first = sorted(
        obstacles, key=lambda each: (each.range_m != each.range_m, each.range_m)
    )
    for number, each in enumerate(nearest_first, start=1):
        table.add_row(
            str(number),
            _metres(each.range_m),
            _metres(each.max_height_m),
            _metres(each.maximum_m[0] - each.minimum_m[0]),
            _metres(each.maximum_m[2] - each.minimum_m[2]),
            str(each.pixels),
            f'{each.left} {each.top} {each.width} {each.height}',
        )
    return table


def _table_of_one(summary: ReplaySummary) -> Table:
    table = Table(
        title=f'Replay of {escape(summary.bag)}, method {summary.config.method}',
        title_justify='left',
        show_header=False,
    )
    table.add_column('quantity')
    table.add_column('value', justify='right')
    table.add_column('remark')
    statistics = summary.statistics
    table.add_row('frames left', str(statistics.left), escape(summary.topics.left_image))
    table.add_row('frames right', str(statistics.right), escape(summary.topics.right_image))
    table.add_row('pairs', str(statistics.pairs), f'{len(summary.frames)} through the detector')
    table.add_row('unmatched', *_unmatched(summary))
    table.add_row('bad frames', str(len(summary.bad_frames)), 'skipped')
    obstacles = [each.summary.obstacles for each in summary.frames]
    table.add_row('obstacles per frame', _mean(obstacles), f'{min(obstacles)} to {max(obstacles)}')
    table.add_section()
    times = stage_times(frame.stage_ms for frame in summary.frames)
    for stage, time in times.items():
        table.add_row(f'{stage}, ms per frame', f'{time.mean_ms:.1f}', f'p95 {time.p95_ms:.1f}')
    total = _total(summary)
    table.add_row('total, ms per frame', f'{total.mean_ms:.1f}', f'p95 {total.p95_ms:.1f}')
    return table


def _table_of_many(summaries: Sequence[ReplaySummary]) -> Table:
    table = Table(
        title=f'Replay of {len(summaries)} bags, method {summaries[0].config.method}',
        title_justify='left',
        show_lines=True,
    )
    table.add_column('bag', overflow='fold')
    for name in ('frames left/right', 'pairs', 'unmatched', 'bad', 'obstacles per frame', 'ms'):
        table.add_column(name, justify='right')
    table.add_column('ms per frame by stage')
    for summary in summaries:
        statistics = summary.statistics
        times = stage_times(frame.stage_ms for frame in summary.frames)
        table.add_row(
            escape(summary.bag),
            f'{statistics.left}/{statistics.right}',
            str(statistics.pairs),
            str(statistics.unmatched_left + statistics.unmatched_right),
            str(len(summary.bad_frames)),
            _mean([each.summary.obstacles for each in summary.frames]),
            f'{_total(summary).mean_ms:.1f}',
            ', '.join(f'{stage} {time.mean_ms:.1f}' for stage, time in times.items()),
        )
    return table


def _total(summary: ReplaySummary) -> StageTime:
    totals = ({'total': sum(frame.stage_ms.values())} for frame in summary.frames)
    return stage_times(totals)['total']


def _unmatched(summary: ReplaySummary) -> tuple[str, str]:
    statistics = summary.statistics
    count = statistics.unmatched_left + statistics.unmatched_right
    remark = f'{statistics.unmatched_left} left, {statistics.unmatched_right} right'
    if count and statistics.smallest_gap_ns:
        remark += f'; smallest stamp gap {statistics.smallest_gap_ns / 1e6:.3f} ms'
    return str(count), remark


def _bad_frames(summary: ReplaySummary) -> Iterable[Text]:
    for bad in summary.bad_frames[:_LISTED_REASONS]:
        yield Text(f'bad frame at {bad.stamp_ns / 1e9:.3f} s: {bad.reason}')
    more = len(summary.bad_frames) - _LISTED_REASONS
    if more > 0:
        yield Text(f'and {more} more bad frames: see summary.json')


def _mean(values: Sequence[float]) -> str:
    return f'{sum(values) / len(values):.1f}'


def _metres(value: float) -> str:
    return f'{value:.2f}' if value == value else '-'
