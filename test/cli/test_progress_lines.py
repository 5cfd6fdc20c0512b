"""Progress in a log: a line every 10 s, with the time left."""

from __future__ import annotations

import pytest

from rover_obstacle_detection.cli import console
from rover_obstacle_detection.cli.progress_lines import ProgressLines


class Clock:
    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


def test_a_line_every_ten_seconds_says_what_is_left(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = ProgressLines(['traverse.mcap'], 'pairs', clock)
    for done in range(1, 122):
        clock.now_s += 0.25
        lines.update(0, done, 800)
    captured = capsys.readouterr()
    assert captured.out == ''
    assert captured.err.splitlines() == [
        'traverse.mcap: 41 of about 800 pairs, 0:10 done, 3:10 left',
        'traverse.mcap: 81 of about 800 pairs, 0:20 done, 3:00 left',
        'traverse.mcap: 121 of about 800 pairs, 0:30 done, 2:50 left',
    ]


def test_a_short_run_says_nothing(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    lines = ProgressLines(['traverse.mcap'], 'pairs', clock)
    # Start-up counts as work done, but not towards the first line.
    clock.now_s += 60
    for done in range(1, 10):
        clock.now_s += 1
        lines.update(0, done, 9)
    assert capsys.readouterr().err == ''


def test_a_task_begins_where_the_one_before_ends(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = ProgressLines(['one', 'two\nlines'], 'frames', clock)
    lines.update(0, 1, 1)
    clock.now_s += 5
    lines.update(1, 1, 1000)
    clock.now_s += 5
    lines.update(1, 2, 1000)
    assert capsys.readouterr().err == (
        'two lines: 2 of about 1000 frames, 0:10 done, 1:23:10 left\n'
    )


def test_a_pipe_gets_lines_instead_of_bars(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr('rover_obstacle_detection.cli.progress_lines.PERIOD_S', 0.0)
    with console.progress_bars(['traverse.mcap'], 'pairs') as update:
        update(0, 120, 120)
    assert capsys.readouterr().err.startswith('traverse.mcap: 120 of about 120 pairs, 0:0')
