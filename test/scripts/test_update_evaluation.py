"""The script that remakes the figures of docs/evaluation.md."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
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


@pytest.fixture(autouse=True)
def scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / 'scripts'))


@pytest.fixture
def results() -> Iterator:
    from evaluation_results import Results

    with Results([BAG], [], ['hybrid'], workers=1, drawn=[BAG]) as made:
        yield made


def test_the_page_has_the_blocks_that_the_script_makes() -> None:
    from evaluation_blocks import BLOCKS

    page = (ROOT / 'docs' / 'evaluation.md').read_text(encoding='utf-8')
    assert re.findall(r'<!-- begin (\S+) -->', page) == list(BLOCKS)
    assert re.findall(r'<!-- end (\S+) -->', page) == list(BLOCKS)


def test_a_block_is_replaced_and_nothing_else() -> None:
    from update_evaluation import check_blocks, with_block

    page = 'before\n<!-- begin a -->\n\nold\n\n<!-- end a -->\nafter\n'
    assert with_block(page, 'a', 'new\n') == page.replace('old', 'new\n').replace('\n\n\n', '\n\n')
    check_blocks(page, ['a'])
    with pytest.raises(SystemExit, match='no block b'):
        check_blocks(page, ['a', 'b'])


def test_the_worst_frames_are_shown_with_their_causes(tmp_path: Path) -> None:
    from evaluation_blocks import worst_frames

    far = Fault('missed rock', 300, 21.0, Cause('outside the judged range', 'max_range is 20 m'))
    figures = Figures(frames=1, true_positives=50, false_negatives=50, rocks=2, rocks_found=1)
    frame = FrameResult(0, figures, 0.2, 0.1, faults=(far,))
    (tmp_path / 'images').mkdir()
    (tmp_path / 'images' / 'evaluation_worst_09.jpg').write_bytes(b'of another run')
    pictures = tuple(Picture(method, 'one', frame, b'jpeg') for method in ('hybrid', 'study'))
    assert worst_frames(Evaluation(pictures=pictures), tmp_path) == (
        '1. one: IoU 0.50, 1 of 2 obstacles found\n\n'
        '   - missed rock of 300 px at 21.0 m: outside the judged range (max_range is 20 m)\n\n'
        '   ![one](images/evaluation_worst_01.jpg)\n'
    )
    assert [path.name for path in (tmp_path / 'images').iterdir()] == ['evaluation_worst_01.jpg']


def test_scenes_are_grouped_by_kind_and_condition() -> None:
    from evaluation_blocks import by_condition

    one, two = (SceneGravity(name, (name, 'rig vga'), ()) for name in ('moon', 'noon'))
    groups = by_condition({'report': [one, two], 'tune': []}.__getitem__)
    assert groups == {
        'all reporting scenes': [one, two],
        'moon': [one],
        'noon': [two],
        'rig vga': [one, two],
    }


def test_nothing_compared_is_a_dash() -> None:
    from evaluation_blocks import clearance_table, gain_table, markdown

    nothing = Evaluation(scenes=(SceneResult('hybrid', 'one', ('noon',), ()),))
    assert markdown(gain_table(nothing)) == '-\n'
    assert markdown(clearance_table(nothing)) == '-\n'
    assert markdown(None) == '-\n'


def test_blocks_of_a_real_scene(results, tmp_path: Path) -> None:
    from evaluation_blocks import BLOCKS

    assert BLOCKS['reporting-scenes'](results, tmp_path).startswith('1 scenes, 1 frames')
    assert '| hybrid | 0.' in BLOCKS['methods'](results, tmp_path)
    assert BLOCKS['tuning'](results, tmp_path) == '-\n'
    assert '| hybrid | 0.' in BLOCKS['drawn'](results, tmp_path)
    assert BLOCKS['drawn-scenes'](results, tmp_path).count('| simulated_vga_moon |') == 1
    assert BLOCKS['gravity-scenes'](results, tmp_path).count('| simulated_vga_moon |') == 1
    assert '| rig vga | 1 |' in BLOCKS['disparity'](results, tmp_path)
    assert '| all | ' in BLOCKS['reliability'](results, tmp_path)
    assert '| hybrid | 0.' in BLOCKS['ablation'](results, tmp_path)
    shown = BLOCKS['worst'](results, tmp_path)
    assert '![simulated_vga_moon](images/evaluation_worst_01.jpg)' in shown
    assert (tmp_path / 'images' / 'evaluation_worst_01.jpg').stat().st_size > 1000


def test_single_blocks_of_chosen_scenes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from update_evaluation import main

    bags = tmp_path / 'bags'
    bags.mkdir()
    for name in ('report_moon', 'report_other', 'tune_moon'):
        (bags / name).symlink_to(BAG)
    page = tmp_path / 'page.md'
    page.write_text(
        '<!-- begin scenes -->\n<!-- end scenes -->\n<!-- begin causes -->\n<!-- end causes -->\n'
    )
    call = ['x', '--bags', str(bags), '--scenes', '*_moon', '--only', 'scenes', '--page']
    monkeypatch.setattr(sys, 'argv', [*call, str(page)])
    main()
    text = page.read_text()
    assert text.count('simulated_vga_moon') == 1
    assert '<!-- begin causes -->\n<!-- end causes -->' in text
    assert 'hybrid, timed: 1 scenes' in capsys.readouterr().err


def test_a_block_that_fails_does_not_hold_up_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import update_evaluation

    def fail(results, folder):
        raise MissingExtraError('the pair needs scikit-image')

    blocks = {'broken': fail, 'whole': lambda results, folder: 'new\n'}
    monkeypatch.setattr(update_evaluation, 'BLOCKS', blocks)
    page = tmp_path / 'page.md'
    marks = ''.join(f'<!-- begin {name} -->\nold\n<!-- end {name} -->\n' for name in blocks)
    page.write_text(marks)
    (tmp_path / 'bags').mkdir()
    call = ['x', '--bags', str(tmp_path / 'bags'), '--method', 'hybrid', '--page', str(page)]
    monkeypatch.setattr(sys, 'argv', call)
    with pytest.raises(SystemExit, match='block broken stays as it was: the pair needs'):
        update_evaluation.main()
    assert page.read_text() == marks.replace('old', '\nnew\n', 2).replace('\nnew\n', 'old', 1)
