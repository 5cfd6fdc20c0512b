"""The HTML report of several replays, with a link to the report of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from urllib.parse import quote

from rover_obstacle_detection import __version__
from rover_obstacle_detection.offline.replay_report import timeline
from rover_obstacle_detection.offline.summary import ReplaySummary
from rover_obstacle_detection.report.page import Page, Section, TableBlock, render_page
from rover_obstacle_detection.wording import counted

_HEADER = (
    'recording',
    'frames',
    'bad frames',
    'with warnings',
    'obstacles per frame',
    'nearest, m',
    'unknown',
    'detection, ms',
)


def combined_html(folders: Sequence[str], summaries: Sequence[ReplaySummary]) -> str:
    """Render the figures and timelines of several replays as one HTML page.

    Parameters
    ----------
    folders : sequence of str
        Name of each replay's folder, beside the page. It holds its ``report.html``.
    summaries : sequence of ReplaySummary
        In the same order.

    Raises
    ------
    MissingExtraError
        If Jinja2 or matplotlib is not installed.
    """
    frames = sum(len(summary.frames) for summary in summaries)
    bad = sum(len(summary.bad_frames) for summary in summaries)
    table = TableBlock(
        'Means over the frames; the nearest obstacle of all, and the median time',
        _HEADER,
        [_row(*each) for each in zip(folders, summaries, strict=True)],
        links=[f'{quote(folder)}/report.html' for folder in folders],
    )
    page = Page(
        title=f'Replay of {counted(len(summaries), "recording")}',
        lead=(
            f'{counted(frames, "frame")} judged, {counted(bad, "bad frame")} skipped. The name of '
            'a recording leads to its own report.',
        ),
        sections=(
            Section('Recordings', (table,)),
            *(
                Section(folder, (timeline(summary),), is_folded=True)
                for folder, summary in zip(folders, summaries, strict=True)
            ),
        ),
        foot=f'rover_obstacle_detection {__version__}',
    )
    # File names need not be valid Unicode.
    return render_page(page).encode('utf-8', 'replace').decode('utf-8')


def _row(folder: str, summary: ReplaySummary) -> tuple[str, ...]:
    figures = [frame.summary for frame in summary.frames]
    nearest_m = min(
        (each.nearest_obstacle_m for each in figures if math.isfinite(each.nearest_obstacle_m)),
        default=math.nan,
    )
    return (
        folder,
        str(len(figures)),
        str(len(summary.bad_frames)),
        str(sum(bool(frame.warnings) for frame in summary.frames)),
        f'{sum(each.obstacles for each in figures) / len(figures):.1f}',
        f'{nearest_m:.2f}' if math.isfinite(nearest_m) else '-',
        f'{sum(each.unknown_share for each in figures) / len(figures):.0%}',
        f'{summary.detection_time.median_ms:.0f}',
    )
