"""The command ``rover-obstacles evaluate``."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from labelled import SHAPE, write_labelled
from recordings import stereo_messages, write_ros2

from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.evaluation.methods import registry
from rover_obstacle_detection.evaluation.methods.names import METHOD_DESCRIPTIONS
from rover_obstacle_detection.offline import evaluate as evaluate_module

SAMPLE_BAG = Path(__file__).parents[2] / 'bags' / 'mars_yard'


@pytest.fixture
def bag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A labelled recording, with every method replaced to flag the upper half of its rock."""
    mask = np.zeros(SHAPE, np.uint8)
    mask[4:12, 2:18] = 255
    for name in METHOD_DESCRIPTIONS:
        monkeypatch.setitem(registry.METHODS, name, lambda config: lambda *_: mask)
    return write_labelled(tmp_path / 'report_noon')


def evaluate(*arguments: object) -> int:
    return main(['evaluate', *map(str, arguments)])


def test_the_table_shows_the_figures(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate(bag) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [line.split() for line in lines if line.startswith('hybrid ')]
    assert rows[-1][:6] == ['hybrid', '0.500', '1.000', '0.500', '0.667', '2/2']


@pytest.mark.parametrize('rectify', ['always', 'by_name'])
def test_which_images_are_rectified_can_be_said(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], rectify: str
) -> None:
    bent = write_labelled(tmp_path / 'bent', distortion=(-0.2, 0.05, 0, 0, 0))
    assert evaluate(bent, '--rectify', rectify) == 0
    said = 'are raw images: rectifying them' in capsys.readouterr().err
    assert said == (rectify == 'always')


def test_the_json_file_has_every_frame(bag: Path, tmp_path: Path) -> None:
    file = tmp_path / 'figures.json'
    assert evaluate(bag, '--method', 'hybrid', '--method', 'wang', '--json', file) == 0
    content = json.loads(file.read_text(encoding='utf-8'))
    assert list(content['methods']) == ['hybrid', 'wang']
    hybrid = content['methods']['hybrid']
    assert hybrid['all']['mean_iou'] == 0.5
    assert hybrid['conditions']['noon']['obstacles_found'] == 2
    (scene,) = hybrid['scenes']
    assert scene['scene'] == 'report_noon'
    assert [frame['true_positives'] for frame in scene['frames']] == [128, 128]
    spans = {each['range']: each for each in hybrid['by_range']}
    assert spans['2-3 m']['rocks'] == 2
    assert spans['4-6 m']['iou'] is None
    assert content['parameters']['max_step'] == 0.1


def test_the_report_has_plots_and_pictures(bag: Path, tmp_path: Path) -> None:
    pytest.importorskip('jinja2', reason='needs the extra report')
    pytest.importorskip('matplotlib', reason='needs the extra report')
    file = tmp_path / 'report.html'
    assert evaluate(bag, '--report', file, '--set', 'max_step=0.2') == 0
    html = file.read_text(encoding='utf-8')
    assert 'report_noon' in html
    assert 'max_step 0.2' in html
    assert html.count('data:image/jpeg;base64,') == 2
    assert html.count('data:image/svg+xml;base64,') >= 5
    assert 'http' not in html


def test_all_runs_the_installed_methods(
    bag: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from rover_obstacle_detection.evaluation.methods.peers import Cloth

    monkeypatch.setitem(registry.METHODS, 'cloth', Cloth)
    monkeypatch.setitem(sys.modules, 'CSF', None)
    assert evaluate(bag, '--method', 'all') == 0
    shown = capsys.readouterr()
    rows = {line.split()[0] for line in shown.out.splitlines() if '0.667' in line}
    assert set(METHOD_DESCRIPTIONS) - {'cloth'} <= rows
    assert 'cloth' not in rows
    assert 'skipped: method cloth needs cloth-simulation-filter' in shown.err


def test_a_missing_library_of_a_method_is_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'pypatchworkpp', None)
    bag = write_labelled(tmp_path / 'bag')
    assert evaluate(bag, '--method', 'patchwork') == 1
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert 'pip install pypatchworkpp' in error


def test_a_missing_library_of_the_report_is_an_error_in_advance(
    bag: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    assert evaluate(bag, '--report', tmp_path / 'report.html') == 1
    shown = capsys.readouterr()
    assert shown.out == ''
    assert 'pip install jinja2 matplotlib' in shown.err


def test_existing_files_need_force(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'figures.json'
    file.write_text('mine', encoding='utf-8')
    assert evaluate(bag, '--json', file) == 1
    assert '--force' in capsys.readouterr().err
    assert file.read_text(encoding='utf-8') == 'mine'
    assert evaluate(bag, '--json', file, '--force') == 0
    assert json.loads(file.read_text(encoding='utf-8'))


def test_a_file_in_a_missing_folder_is_an_error_in_advance(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert evaluate(bag, '--json', tmp_path / 'nowhere' / 'figures.json') == 1
    shown = capsys.readouterr()
    assert shown.out == ''
    assert 'nowhere' in shown.err


def test_a_recording_without_labels_is_reported_and_others_evaluated(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = write_ros2(tmp_path / 'unlabelled', stereo_messages(1))
    assert evaluate(other, bag) == 1
    shown = capsys.readouterr()
    assert 'report_noon' in shown.out
    assert 'unlabelled: no topic truth/labels' in shown.err


def test_an_interrupt_keeps_the_recordings_that_are_done(
    bag: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    other = write_labelled(tmp_path / 'other')
    find = evaluate_module.find_truth_topics

    def interrupt(reader, topic):
        if reader.path == other:
            os.kill(os.getpid(), signal.SIGINT)
        return find(reader, topic)

    monkeypatch.setattr(evaluate_module, 'find_truth_topics', interrupt)
    file = tmp_path / 'figures.json'
    assert evaluate(bag, other, '--json', file) == 130
    assert capsys.readouterr().err == f'rover-obstacles: interrupted: {other} is not evaluated\n'
    content = json.loads(file.read_text(encoding='utf-8'))
    (scene,) = content['methods']['hybrid']['scenes']
    assert scene['scene'] == 'report_noon'


def test_conditions_can_be_given(bag: Path, tmp_path: Path) -> None:
    file = tmp_path / 'figures.json'
    assert evaluate(bag, '--condition', 'dusk', '--condition', 'dust', '--json', file) == 0
    content = json.loads(file.read_text(encoding='utf-8'))
    assert list(content['methods']['hybrid']['conditions']) == ['dusk', 'dust']


def test_an_unknown_method_is_a_usage_error(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        evaluate(bag, '--method', 'magic')
    assert ended.value.code == 2
    assert 'magic' in capsys.readouterr().err


def test_the_real_detector_on_the_sample_bag(tmp_path: Path) -> None:
    file = tmp_path / 'figures.json'
    arguments = ('--method', 'hybrid', '--method', 'depth_only', '--json', file, '--every', '2')
    assert evaluate(SAMPLE_BAG, *arguments) == 0
    content = json.loads(file.read_text(encoding='utf-8'))
    hybrid, depth_only = (content['methods'][name]['all'] for name in ('hybrid', 'depth_only'))
    assert hybrid['frames'] == 2
    assert hybrid['obstacles'] == 5
    assert hybrid['iou'] > 0.8
    assert hybrid['iou'] > depth_only['iou'] > 0.2
    step = content['distributions']['hybrid']['step']
    assert step['separation'] > 0.6
