"""Tables of replays are complete and readable in 80 columns."""

from __future__ import annotations

import io
import re
from dataclasses import replace

import pytest
from rich.console import Console

from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.offline.summary import FrameSummary, ReplayFrame, ReplaySummary
from rover_obstacle_detection.offline.summary_table import replay_table
from rover_obstacle_detection.pairing import PairingStatistics

LEFT = '/rover/front/hazcam/left/image_rect_color/compressed'
FIGURES = FrameSummary(
    obstacles=3,
    obstacle_kinds={'rock': 10123, 'slope': 221},
    obstacle_share=0.1,
    matched_share=0.9,
    unknown_share=0.2,
    nearest_obstacle_m=1.0,
    tallest_obstacle_m=0.2,
    camera_pitch_deg=40.0,
    camera_height_m=1.0,
    rows_off_px=0.0,
    lens_bend_px=0.0,
)
STAGES = {'read': 1.0, 'coarse disparity': 1234.5}
SUMMARY = ReplaySummary(
    bag='/data/traverse_2026_11_29_morning_run_3.mcap',
    notes=(),
    topics=StereoTopics(LEFT, LEFT.replace('left', 'right')),
    calibration='left.yaml and right.yaml',
    cameras=(),
    config=DetectorConfig(),
    statistics=PairingStatistics(12000, 12000, 11900, 100, 100, 0, 0, 3_400_000),
    frames=(ReplayFrame(1, 1_000_000_000, FIGURES, STAGES),),
    bad_frames=(),
    expected=12000,
    interrupted=True,
)


def printed(*summaries: ReplaySummary) -> str:
    file = io.StringIO()
    Console(file=file, width=80, highlight=False).print(replay_table(summaries))
    return file.getvalue()


def column(text: str, index: int) -> str:
    """The text of a column, without the line breaks of its cells."""
    rows = [re.split('[│┃]', line)[1:-1] for line in text.splitlines() if line[0] in '│┃']
    return ''.join(row[index].strip() for row in rows)


def test_long_topics_and_names_are_complete() -> None:
    text = printed(SUMMARY)

    assert max(map(len, text.splitlines())) <= 80
    assert '…' not in text
    assert 'traverse_2026_11_29_morning_run_3.mcap' in column(text, 1)
    assert LEFT in column(text, 2)
    assert LEFT.replace('left', 'right') in column(text, 2)


@pytest.mark.parametrize('count', [1, 4, 7])
def test_each_row_has_its_name_on_one_line(count: int) -> None:
    names = [f'/data/day{number}/traverse_2026_11_29_morning' for number in range(count)]
    text = printed(*(replace(SUMMARY, bag=name) for name in names))

    assert max(map(len, text.splitlines())) <= 80
    assert '…' not in text
    for name in ('of these unjudgeable', 'coarse disparity, ms per frame', 'obstacles per frame'):
        assert f' {name} ' in text
    assert text.count('12000') >= 2 * count


@pytest.mark.parametrize(
    ('rows_px', 'lens_px', 'is_told'), [(2.9, 0.1, True), (0.2, 1.0, True), (0.9, 0.9, False)]
)
def test_a_rectification_error_is_told_with_what_to_do(rows_px, lens_px, is_told) -> None:
    figures = replace(FIGURES, rows_off_px=rows_px, lens_bend_px=lens_px)
    outlier = replace(FIGURES, rows_off_px=40.0)
    frames = [ReplayFrame(1, 0, each, STAGES) for each in (figures, figures, outlier)]
    words = ' '.join(printed(replace(SUMMARY, frames=tuple(frames))).split())
    told = f'rows off by {rows_px:.1f} px, lens distortion {lens_px:.1f} px (medians)'
    assert (told in words) == is_told
    assert ('rover-obstacles inspect --write-calibration' in words) == is_told
