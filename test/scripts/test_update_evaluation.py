"""The script that updates the evaluation pages."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import update_evaluation
from evaluation_blocks import (
    PAGES,
    SUMMARY_BLOCKS,
    TABLE_BLOCKS,
    by_condition,
    clearance_table,
    gain_table,
    markdown,
    worst_frames,
)
from evaluation_results import Results
from generated_blocks import check_block, with_block
from studies.gravity_study import SceneGravity

from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.evaluation.causes import Cause
from rover_obstacle_detection.evaluation.faults import Fault
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.results import (
    Evaluation,
    FrameResult,
    Picture,
    SceneResult,
)

ROOT = Path(__file__).parents[2]
BAG = ROOT / 'bags' / 'simulated_vga_moon'


@pytest.fixture
def results() -> Iterator[Results]:
    with Results([BAG], [], ['hybrid'], workers=1, drawn=[BAG]) as made:
        yield made


def empty_blocks(*names: str) -> str:
    return ''.join(f'<!-- begin {name} -->\n<!-- end {name} -->\n' for name in names)


def test_pages_have_the_blocks_of_the_script() -> None:
    for name, blocks in PAGES.items():
        page = (ROOT / 'docs' / name).read_text(encoding='utf-8')
        assert re.findall(r'<!-- begin (\S+) -->', page) == list(blocks)
        assert re.findall(r'<!-- end (\S+) -->', page) == list(blocks)


def test_block_is_replaced_and_nothing_else(tmp_path: Path) -> None:
    text = 'before\n<!-- begin a -->\n\nold\n\n<!-- end a -->\nafter\n'
    assert with_block(text, 'a', 'new\n') == text.replace('old', 'new\n').replace('\n\n\n', '\n\n')
    page = tmp_path / 'page.md'
    page.write_text(text)
    check_block(page, 'a')
    with pytest.raises(SystemExit, match='no block b'):
        check_block(page, 'b')


def test_worst_frames_are_listed_with_their_causes(tmp_path: Path) -> None:
    far = Fault('missed rock', 300, 21.0, Cause('beyond the detection range', 'max_range 20 m'))
    figures = Figures(frames=1, true_positives=50, false_negatives=50, rocks=2, rocks_found=1)
    frame = FrameResult(0, figures, 0.2, 0.1, faults=(far,))
    (tmp_path / 'images').mkdir()
    (tmp_path / 'images' / 'evaluation_worst_09.jpg').write_bytes(b'old')
    pictures = tuple(Picture(method, 'one', frame, b'jpeg') for method in ('hybrid', 'study'))
    assert worst_frames(Evaluation(pictures=pictures), tmp_path) == (
        '1. one: IoU 0.50, 1 of 2 obstacles found\n\n'
        '   - missed rock of 300 px at 21.0 m: beyond the detection range (max_range 20 m)\n\n'
        '   ![one](images/evaluation_worst_01.jpg)\n'
    )
    assert [path.name for path in (tmp_path / 'images').iterdir()] == ['evaluation_worst_01.jpg']


def test_scenes_are_grouped_by_suite_and_condition() -> None:
    one, two = (SceneGravity(name, (name, 'rig vga'), ()) for name in ('moon', 'noon'))
    groups = by_condition({'report': [one, two], 'tune': []}.__getitem__)
    assert groups == {
        'all reporting scenes': [one, two],
        'moon': [one],
        'noon': [two],
        'rig vga': [one, two],
    }


def test_empty_table_is_a_dash() -> None:
    nothing = Evaluation(scenes=(SceneResult('hybrid', 'one', ('noon',), ()),))
    assert markdown(gain_table(nothing)) == '-\n'
    assert markdown(clearance_table(nothing)) == '-\n'
    assert markdown(None) == '-\n'


def test_blocks_of_a_real_scene(results: Results, tmp_path: Path) -> None:
    assert TABLE_BLOCKS['reporting-scenes'](results, tmp_path).startswith('1 scenes, 1 frames')
    assert '| hybrid | 0.' in TABLE_BLOCKS['methods'](results, tmp_path)
    assert TABLE_BLOCKS['tuning'](results, tmp_path) == '-\n'
    assert '| hybrid | 0.' in TABLE_BLOCKS['drawn'](results, tmp_path)
    assert TABLE_BLOCKS['drawn-scenes'](results, tmp_path).count('| simulated_vga_moon |') == 1
    assert TABLE_BLOCKS['gravity-scenes'](results, tmp_path).count('| simulated_vga_moon |') == 1
    assert '| rig vga | 1 |' in TABLE_BLOCKS['disparity'](results, tmp_path)
    assert '| all | ' in TABLE_BLOCKS['reliability'](results, tmp_path)
    assert '| hybrid | 0.' in TABLE_BLOCKS['ablation'](results, tmp_path)
    assert '| hybrid | 0.' in SUMMARY_BLOCKS['summary'](results, tmp_path)
    suites = SUMMARY_BLOCKS['suites'](results, tmp_path)
    assert re.findall(r'^\| (\w+) \| 1 \| 0\.', suites, re.M) == ['reporting', 'drawn']
    assert '| outlines | -' in SUMMARY_BLOCKS['stages'](results, tmp_path)
    assert '| missed rock | ' in SUMMARY_BLOCKS['failures'](results, tmp_path)
    shown = TABLE_BLOCKS['worst'](results, tmp_path)
    assert '![simulated_vga_moon](images/evaluation_worst_01.jpg)' in shown
    assert (tmp_path / 'images' / 'evaluation_worst_01.jpg').stat().st_size > 1000


def test_single_blocks_of_chosen_scenes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bags = tmp_path / 'bags'
    bags.mkdir()
    for name in ('report_moon', 'report_other', 'tune_moon'):
        (bags / name).symlink_to(BAG)
    (tmp_path / 'evaluation_tables.md').write_text(empty_blocks('scenes', 'causes'))
    (tmp_path / 'evaluation.md').write_text(empty_blocks('suites'))
    call = ['x', '--bags', str(bags), '--scenes', '*_moon', '--only', 'scenes', 'suites', '--docs']
    monkeypatch.setattr(sys, 'argv', [*call, str(tmp_path)])
    update_evaluation.main()
    assert '| reporting | 1 |' in (tmp_path / 'evaluation.md').read_text()
    text = (tmp_path / 'evaluation_tables.md').read_text()
    assert text.count('simulated_vga_moon') == 1
    assert '<!-- begin causes -->\n<!-- end causes -->' in text
    assert 'hybrid, timed: 1 scenes' in capsys.readouterr().err


def test_failing_block_does_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(results, folder):
        raise MissingExtraError('the pair needs scikit-image')

    blocks = {'broken': fail, 'whole': lambda results, folder: 'new\n'}
    monkeypatch.setattr(update_evaluation, 'PAGES', {'page.md': blocks})
    page = tmp_path / 'page.md'
    marks = ''.join(f'<!-- begin {name} -->\nold\n<!-- end {name} -->\n' for name in blocks)
    page.write_text(marks)
    (tmp_path / 'bags').mkdir()
    call = ['x', '--bags', str(tmp_path / 'bags'), '--method', 'hybrid', '--docs', str(tmp_path)]
    monkeypatch.setattr(sys, 'argv', call)
    with pytest.raises(SystemExit, match='block broken not updated: the pair needs'):
        update_evaluation.main()
    assert page.read_text() == marks.replace('old', '\nnew\n', 2).replace('\nnew\n', 'old', 1)
