"""The command that measures every performance target; no time is judged here."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import benchmark_scenes
import clouds
import detection_times
import growth
import performance
import pytest
from findings import Findings, Line, at_least, at_most
from performance import BLOCKS, PAGE, PARTS

from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.evaluation.tables import Table

ROOT = Path(__file__).parents[2]
BAG = ROOT / 'bags' / 'mars_yard'
# As many as there are: the process of the tests keeps its cores.
ALL_CORES = ['--cores', '1024']
NUMBER = r'-?\d+(?:\.\d+)?'


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr(sys, 'argv', ['performance', *ALL_CORES, *arguments])
    performance.main()


def pages(folder: Path) -> Path:
    page = folder / PAGE
    marks = (
        f'before {name}\n<!-- begin {name} -->\nold\n<!-- end {name} -->\n' for name in BLOCKS
    )
    page.write_text(''.join(marks))
    return page


def test_page_has_the_blocks_of_the_command() -> None:
    page = (ROOT / 'docs' / PAGE).read_text(encoding='utf-8')
    assert re.findall(r'<!-- begin (\S+) -->', page) == list(BLOCKS)
    assert re.findall(r'<!-- end (\S+) -->', page) == list(BLOCKS)


def test_every_block_of_the_page_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = pages(tmp_path)
    tables = {name: Table(name, ('a', 'b'), [('x', '1')]) for name in ('stages', 'curve', 'sizes')}
    found = Findings((at_most('time', 3.0, 1.0), Line('free', '7 ms')), tables)
    monkeypatch.setattr(performance, 'PARTS', {'all': lambda scenes, effort: found})

    run(monkeypatch, '--docs', str(tmp_path), '--quick', '--bags', str(BAG))

    text = page.read_text()
    assert 'old' not in text
    assert re.search(r'begin machine -->\n\n.*NumPy .*1 scenes: 1 of 1024 x 768\.\n', text)
    assert '| time | at most 1.00 x SGBM | 3.00 x SGBM | no |\n| free | - | 7 ms | - |\n' in text
    assert text.count('| a | b |\n| --- | ---: |\n| x | 1 |\n') == 3
    assert [f'before {name}\n<!-- begin {name}' in text for name in BLOCKS] == [True] * 5


def test_failing_part_does_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(scenes, effort):
        raise BagError('no pair')

    page = pages(tmp_path)
    sizes = Findings((Line('free', '7 ms'),), {'sizes': Table('Sizes', ('a', 'b'), [('x', '1')])})
    parts = {'detection': fail, 'growth': lambda scenes, effort: sizes}
    monkeypatch.setattr(performance, 'PARTS', parts)

    with pytest.raises(SystemExit, match=r'^all of detection: not measured: it failed$'):
        run(monkeypatch, '--docs', str(tmp_path), '--quick', '--bags', str(BAG))

    assert 'BagError: no pair' in capsys.readouterr().err
    text = page.read_text()
    assert (
        '| all of detection | - | not measured: it failed | - |\n| free | - | 7 ms | - |' in text
    )
    assert text.count('-->\nold\n<!--') == 2


def test_page_without_a_block_is_refused_before_anything_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / PAGE).write_text('nothing')
    monkeypatch.setattr(performance, 'PARTS', {})
    with pytest.raises(SystemExit, match='has no block machine'):
        run(monkeypatch, '--docs', str(tmp_path))


def test_page_needs_all_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        run(monkeypatch, '--docs', str(tmp_path), '--only', 'growth')
    assert '--docs needs all parts' in capsys.readouterr().err


def test_lines_say_whether_the_goal_is_met() -> None:
    assert at_most('time', 1.0, 1.0).met is True
    assert at_most('time', 1.01, 1.0).met is False
    assert at_least('gain', 1.6, 1.6, '{:.1f} x').met is True
    assert str(at_least('gain', 1.5, 1.6, '{:.1f} x')) == (
        'gain: 1.5 x (goal: at least 1.6 x; met: no)'
    )
    assert str(Line('free', '7 ms')) == 'free: 7 ms'


def test_quick_run_prints_each_figure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert list(PARTS) == ['detection', 'live', 'clouds', 'growth', 'replay']
    noon, moon = (ROOT / 'bags' / f'simulated_{name}' for name in ('study_noon', 'vga_moon'))
    # No figure depends on the size of the images.
    for module in (benchmark_scenes, clouds, detection_times, growth):
        monkeypatch.setattr(module, 'STANDARD', (512, 384))
    parts = ['--only', 'detection', 'clouds', 'growth']

    run(monkeypatch, '--quick', '--bags', str(noon), str(moon), *parts)

    printed = capsys.readouterr().out
    goal = r' \(goal: .+; met: (yes|no)\)$'
    for expected in (
        r'^.*, \d+ of \d+ cores used, .* load average ' + NUMBER + ' at the start$',
        r'^2 scenes: 1 of 512 x 384, 1 of 400 x 300\.$',
        rf'^detection at 512 x 384, median of 1 scenes: {NUMBER} x SGBM{goal}',
        rf'^detection at 512 x 384, worst scene: {NUMBER} x SGBM{goal}',
        rf"^detection at 512 x 384, median of CPU time relative to SGBM's: {NUMBER} x$",
        rf'^detection at 512 x 384, median: {NUMBER} ms$',
        rf'^plain SGBM at 512 x 384, median: {NUMBER} ms$',
        rf'^detection in smaller images, median of 1 scenes: {NUMBER} x its own SGBM, worst',
        rf"^speed relative to the study's listing, 1 scenes: {NUMBER} x{goal}",
        rf'^\| outlines \| {NUMBER} \| {NUMBER} \|$',
        rf'^\| clouds and obstacles, on request \| {NUMBER} \| {NUMBER} \|$',
        rf'^\| `speed` accurate \(default\) \| ({NUMBER} \| ){{3}}0\.\d+ \| 0\.\d+ \| 5/5 \| ',
        rf'^\| `speed` fast \| ({NUMBER} \| ){{3}}0\.\d+ \| 0\.\d+ \| \d/5 \| ',
        rf'^CPU time per frame, .*: {NUMBER} ms; stereo_image_proc {NUMBER} ms{goal}',
        r'^`ground_points` at .*, thinned to 0\.05 m \(default\): \d+ points, \d+ kB$',
        r'^`ground_points` at .*, a point for each pixel: \d+ points, \d+ kB$',
        rf'^time grows with .*\(simulated_study_noon 0, 320 x 240 to 640 x 480\): {NUMBER}{goal}',
        rf'^time with 28 rocks relative to one rock, .*: {NUMBER} x \(\d+ and \d+ ms\){goal}',
        rf'^\| 640 x 480 \| {NUMBER} \| {NUMBER} \| {NUMBER} \| {NUMBER} \|$',
    ):
        assert re.search(expected, printed, re.MULTILINE), expected
