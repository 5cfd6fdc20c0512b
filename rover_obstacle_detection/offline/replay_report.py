"""The HTML report of a replay."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from pathlib import PurePath

from rover_obstacle_detection import __version__
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.offline.replay_gallery import RANKINGS, Gallery
from rover_obstacle_detection.offline.summary import ReplayFrame, ReplaySummary
from rover_obstacle_detection.report.page import (
    Page,
    PictureBlock,
    Section,
    TableBlock,
    TextBlock,
    render_page,
)
from rover_obstacle_detection.report.plots import Panel, timeline_plot
from rover_obstacle_detection.warning_kinds import count_warnings
from rover_obstacle_detection.wording import counted

TEMPLATE = 'replay.html.j2'
LISTED_BAD_FRAMES = 50
_SVG = 'image/svg+xml'
_FIGURES = ('time, s', 'obstacles', 'nearest, m', 'unknown', 'detection, ms', 'warnings')
# Bad frames further than this from the others, in lengths of the recording, have another clock.
_REACH = 10.0
_NANOSECONDS = 1_000_000_000
# From 2000 to 2100; other stamps count from the start of a computer or a simulation.
_PLAUSIBLE_NS = (946_684_800 * _NANOSECONDS, 4_102_444_800 * _NANOSECONDS)


@dataclasses.dataclass(frozen=True)
class _ShownFrame:
    """A frame that can be looked at."""

    number: int
    text: str
    warnings: Sequence[str]
    pictures: Sequence[PictureBlock]


def replay_html(summary: ReplaySummary, gallery: Gallery, command_line: str) -> str:
    """Render a replay as one HTML page without external files.

    Parameters
    ----------
    summary : ReplaySummary
    gallery : Gallery
        The frames to show.
    command_line : str

    Raises
    ------
    MissingExtraError
        If Jinja2 or matplotlib is not installed.
    """
    page = Page(
        title=f'Replay of {PurePath(summary.bag).name}',
        lead=tuple(_lead(summary)),
        sections=tuple(_sections(summary, command_line)),
        foot=f'rover_obstacle_detection {__version__}',
    )
    frames = {frame.number: frame for frame in summary.frames}
    shown = [
        _ShownFrame(number, _figures_text(frames[number], summary), frames[number].warnings, each)
        for number, each in sorted(gallery.pictures.items())
    ]
    html = render_page(
        page,
        TEMPLATE,
        timeline=timeline(summary),
        frames=shown,
        embedded=_embedded(len(shown), len(frames)),
        worst=[
            TableBlock(
                name.capitalize(),
                ('frame', *_FIGURES),
                [_figures(frames[number], summary) for number in gallery.worst(name)],
            )
            for name in RANKINGS
            if gallery.worst(name)
        ],
    )
    # File names need not be valid Unicode.
    return html.encode('utf-8', 'replace').decode('utf-8')


def _lead(summary: ReplaySummary) -> Iterator[str]:
    warned = sum(bool(frame.warnings) for frame in summary.frames)
    obstacles = [frame.summary.obstacles for frame in summary.frames]
    yield (
        f'{counted(len(obstacles), "frame")} judged, '
        f'{counted(len(summary.bad_frames), "bad frame")} skipped, '
        f'{counted(warned, "frame")} with warnings. Obstacles per frame: '
        f'{sum(obstacles) / len(obstacles):.1f} ({min(obstacles)} to {max(obstacles)}). '
        f'Detection: {summary.detection_time.median_ms:.0f} ms (median).'
    )
    if summary.interrupted:
        yield (
            f'The replay was interrupted after {summary.done} of about {summary.expected} pairs: '
            'the rest of the recording is not in this report.'
        )


def _embedded(shown: int, frames: int) -> str:
    if shown == frames:
        return f'All {frames} frames. Arrow keys move the slider.' if frames > 1 else 'One frame.'
    return (
        f'{shown} of {frames} frames are embedded: evenly chosen ones, and the worst. Arrow keys '
        'move the slider. The option --images writes the pictures of all frames.'
    )


def _figures(frame: ReplayFrame, summary: ReplaySummary) -> tuple[str, ...]:
    figures = frame.summary
    return (
        str(frame.number),
        f'{_seconds(frame.stamp_ns, summary):.2f}',
        str(figures.obstacles),
        _number(figures.nearest_obstacle_m),
        f'{figures.unknown_share:.0%}',
        f'{frame.detection_ms:.0f}',
        str(len(frame.warnings)),
    )


def _figures_text(frame: ReplayFrame, summary: ReplaySummary) -> str:
    figures = frame.summary
    kinds = ', '.join(f'{count} {kind}' for kind, count in figures.obstacle_kinds.items())
    nearest = ''
    if math.isfinite(figures.nearest_obstacle_m):
        nearest = f', nearest at {figures.nearest_obstacle_m:.2f} m'
    return (
        f'Frame {frame.number} of {len(summary.frames)}, {_stamp(frame.stamp_ns)}, '
        f'{_seconds(frame.stamp_ns, summary):.2f} s from the first. Obstacles: {kinds or "none"}'
        f'{nearest}. Unknown: {figures.unknown_share:.0%}. Detection: {frame.detection_ms:.0f} ms.'
    )


def timeline(summary: ReplaySummary) -> PictureBlock:
    """Plot the figures of all frames over time."""
    frames = sorted(summary.frames, key=lambda frame: frame.stamp_ns)
    times = [_seconds(frame.stamp_ns, summary) for frame in frames]
    reach_s = _REACH * max(times[-1] - times[0], 1.0)
    bad = [
        min(max(_seconds(each.stamp_ns, summary), times[0] - reach_s), times[-1] + reach_s)
        for each in summary.bad_frames
    ]
    warned = [time for time, frame in zip(times, frames, strict=True) if frame.warnings]
    figures = [frame.summary for frame in frames]
    panels = (
        Panel('obstacles', [each.obstacles for each in figures]),
        Panel('nearest, m', [each.nearest_obstacle_m for each in figures]),
        Panel('unknown, %', [100 * each.unknown_share for each in figures]),
        Panel('detection, ms', [frame.detection_ms for frame in frames]),
    )
    return PictureBlock(
        'Each frame: number of obstacles, distance of the nearest, share of unknown pixels, time '
        f'in the detector. Orange: warnings ({len(warned)}). Red: bad frames ({len(bad)}).',
        timeline_plot(times, panels, warned, bad, 'seconds from the first frame'),
        _SVG,
    )


def _sections(summary: ReplaySummary, command_line: str) -> Iterator[Section]:
    yield Section('Bad frames', tuple(_bad_frames(summary)))
    yield Section('Warnings', (_warnings(summary),))
    yield Section('What was replayed', (_inputs(summary, command_line), _parameters(summary)))


def _bad_frames(summary: ReplaySummary) -> Iterator[TextBlock | TableBlock]:
    bad = summary.bad_frames
    if not bad:
        yield TextBlock('None.')
        return
    skipped = counted(len(bad), 'message or pair', 'messages or pairs')
    complete = counted(summary.unjudgeable, 'complete pair')
    yield TextBlock(f'{skipped} skipped; among them {complete} that the detector cannot judge.')
    kinds = count_warnings((each.stamp_ns, (each.reason,)) for each in bad)
    yield TableBlock(
        'Reasons',
        ('reason of the first', 'bad frames', 'first at'),
        [(each.text, str(each.frames), _stamp(each.first_stamp_ns)) for each in kinds],
    )
    listed = bad[:LISTED_BAD_FRAMES]
    caption = f'The first {len(listed)}; all are in summary.json'
    yield TableBlock(
        'Each' if len(listed) == len(bad) else caption,
        ('stamp', 'time, s', 'reason'),
        [
            (_stamp(each.stamp_ns), f'{_seconds(each.stamp_ns, summary):.2f}', each.reason)
            for each in listed
        ],
    )


def _warnings(summary: ReplaySummary) -> TextBlock | TableBlock:
    if not summary.warnings:
        return TextBlock('None.')
    return TableBlock(
        'Frames that are less trustworthy',
        ('warning of the first', 'frames', 'first at'),
        [(each.text, str(each.frames), _stamp(each.first_stamp_ns)) for each in summary.warnings],
    )


def _inputs(summary: ReplaySummary, command_line: str) -> TableBlock:
    topics, statistics = summary.topics, summary.statistics
    first, last = summary.frames[0].stamp_ns, summary.frames[-1].stamp_ns
    rows = [
        ('command line', command_line or '-'),
        ('written', f'{datetime.now(timezone.utc):%Y-%m-%d %H:%M:%S} UTC'),
        ('version', __version__),
        ('bag', summary.bag),
        *(('damage', note) for note in summary.notes),
        ('first frame', _moment(first)),
        ('last frame', f'{_moment(last)}, {(last - first) / _NANOSECONDS:.2f} s later'),
        ('left images', f'{statistics.left}, {topics.left_image}'),
        ('right images', f'{statistics.right}, {topics.right_image}'),
        ('calibration', summary.calibration),
        (
            'pairs',
            f'{statistics.pairs}; unmatched {statistics.unmatched_left} left, '
            f'{statistics.unmatched_right} right',
        ),
        *(
            (
                'camera',
                f'{each.width} x {each.height} px, f {each.fx:.1f} px, baseline '
                f'{each.baseline_m:.4f} m',
            )
            for each in summary.cameras
        ),
    ]
    return TableBlock('Input', ('', ''), rows)


def _parameters(summary: ReplaySummary) -> TextBlock | TableBlock:
    default = DetectorConfig()
    rows = [
        (each.name, str(getattr(summary.config, each.name)), str(getattr(default, each.name)))
        for each in dataclasses.fields(default)
        if getattr(summary.config, each.name) != getattr(default, each.name)
    ]
    if not rows:
        return TextBlock('All parameters have their default.')
    return TableBlock('Parameters that differ from their default', ('', 'value', 'default'), rows)


def _seconds(stamp_ns: int, summary: ReplaySummary) -> float:
    """Return the time since the first frame."""
    return (stamp_ns - summary.frames[0].stamp_ns) / _NANOSECONDS


def _stamp(stamp_ns: int) -> str:
    return f'{stamp_ns / _NANOSECONDS:.3f} s'


def _moment(stamp_ns: int) -> str:
    """Return a stamp, and the date if it counts from 1970."""
    if not _PLAUSIBLE_NS[0] < stamp_ns < _PLAUSIBLE_NS[1]:
        return _stamp(stamp_ns)
    date = datetime.fromtimestamp(stamp_ns // _NANOSECONDS, timezone.utc)
    return f'{_stamp(stamp_ns)} ({date:%Y-%m-%d %H:%M:%S} UTC)'


def _number(value: float) -> str:
    return f'{value:.2f}' if math.isfinite(value) else '-'
