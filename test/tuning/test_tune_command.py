"""``rover-obstacles tune`` from the command line."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest
from labelled import write_labelled

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.parameter_file import load_config
from rover_obstacle_detection.tuning import tune as tune_module

BAGS = Path(__file__).parents[2] / 'bags'
SMALL_BAGS = sorted(BAGS.glob('simulated_*'))

needs_tune = pytest.mark.skipif(
    importlib.util.find_spec('optuna') is None, reason='needs the extra tune'
)


@pytest.fixture
def bags(tmp_path: Path) -> list[Path]:
    return [write_labelled(tmp_path / f'day{number}') for number in range(3)]


def tune(*arguments: object) -> int:
    return main(['tune', *map(str, arguments)])


@needs_tune
def test_three_small_bags_end_to_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, figures = tmp_path / 'tuned.yaml', tmp_path / 'tuned.json'
    arguments = (*SMALL_BAGS, '--trials', 3, '--set', 'max_step=0.12', '--json', figures)
    assert tune(*arguments, '-o', file) == 0
    shown = capsys.readouterr()
    content = json.loads(figures.read_text(encoding='utf-8'))
    assert content['format'] == 'rover_obstacle_detection tune'
    assert len(content['trials']) == 3
    assert content['parameters_before']['max_step'] == 0.12
    assert content['tuned_on']['tuned']['scenes'] == 2
    assert content['held_out']['tuned']['scenes'] == 1
    assert content['tuned_on']['tuned']['score'] >= content['tuned_on']['before']['score']
    before = content['held_out']['before']
    assert before['pooled']['obstacles'] > 0
    assert f'{before["mean_iou"]:.3f}' in shown.out
    config = load_config(file)
    assert config.max_step == 0.12
    assert vars(config) == content['parameters']
    assert content['conclusion'] in (shown.out + shown.err)
    again = tmp_path / 'again.yaml'
    assert tune(*arguments, '-o', again, '--force') == 0
    assert again.read_text(encoding='utf-8') == file.read_text(encoding='utf-8')


@needs_tune
def test_one_bag_alone_is_not_called_a_proof(
    bags: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = tmp_path / 'tuned.json'
    assert tune(bags[0], '--trials', 2, '-o', tmp_path / 'x.yaml', '--json', figures) == 0
    content = json.loads(figures.read_text(encoding='utf-8'))
    assert content['held_out'] is None
    assert content['held_out_reason'] == 'there is one bag only'
    assert 'eld out,' not in capsys.readouterr().out


@needs_tune
def test_folds(bags: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = tmp_path / 'tuned.json'
    arguments = ('--trials', 2, '--folds', 3, '-o', tmp_path / 'x.yaml', '--json', figures)
    assert tune(*bags, *arguments) == 0
    content = json.loads(figures.read_text(encoding='utf-8'))
    assert content['tuned_on']['tuned']['scenes'] == content['held_out']['tuned']['scenes'] == 3
    assert [len(fold['tuned_on']) for fold in content['folds']] == [2, 2, 2]
    assert 'tuned without them' in capsys.readouterr().out


@needs_tune
def test_worse_on_held_out_bags_is_a_warning_and_the_file_is_written(
    bags: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from rover_obstacle_detection.evaluation.figures import Figures

    def figures_of(config, scene):
        missed = config.dark_grey_level if scene.name == 'day2' else 255 - config.dark_grey_level
        return Figures(frames=1, true_positives=300 - missed, false_negatives=missed)

    monkeypatch.setattr(tune_module, 'figures_of', figures_of)
    file = tmp_path / 'tuned.yaml'
    assert tune(*bags, '--held-out', bags[2], '-o', file, '--parameter', 'dark_grey_level') == 0
    assert load_config(file).dark_grey_level > 50
    error = capsys.readouterr().err
    assert 'WARNING: On the held-out bags the tuned parameters are worse' in error


@needs_tune
def test_ctrl_c_writes_the_best_so_far(
    bags: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = []

    def interrupted(config, scene):
        calls.append(config)
        if len(calls) == 7:
            raise KeyboardInterrupt
        return figures_of(config, scene)

    figures_of = tune_module.figures_of
    monkeypatch.setattr(tune_module, 'figures_of', interrupted)
    file = tmp_path / 'tuned.yaml'
    assert tune(*bags, '--held-out-share', 0.4, '-o', file) == 0
    assert 'interrupted after 3 trials' in capsys.readouterr().out
    assert load_config(file)


@needs_tune
def test_a_limit_of_the_rover_is_tuned_with_a_warning_only(
    bags: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert tune(*bags, '--parameter', 'max_step', '--trials', 1, '-o', tmp_path / 'x.yaml') == 0
    assert 'WARNING: max_step is what the rover can do' in capsys.readouterr().err
    assert load_config(tmp_path / 'x.yaml') == DetectorConfig()


def test_the_missing_optimiser_is_one_line_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'optuna', None)
    assert tune(tmp_path / 'nowhere', '-o', tmp_path / 'x.yaml') == 1
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert "pip install 'rover_obstacle_detection[tune]'" in error


@needs_tune
@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--set', 'method=study'), 'name those of study with --parameter'),
        (('--memory', '1', '--folds', '4'), 'cannot be shared out among 4 folds'),
        (('--labels-topic', '/nowhere'), 'topic /nowhere is not there'),
    ],
)
def test_what_cannot_be_done_is_one_line(
    arguments: tuple[str, ...],
    words: str,
    bags: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = tmp_path / 'x.yaml'
    assert tune(*bags, '-o', file, *arguments) == 1
    error = capsys.readouterr().err
    assert words in error
    assert error.count('\n') == 1
    assert not file.exists()


@needs_tune
def test_a_file_that_exists_is_kept_unless_forced(
    bags: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'x.yaml'
    file.write_text('mine', encoding='utf-8')
    assert tune(*bags, '-o', file) == 1
    assert 'give --force' in capsys.readouterr().err
    assert file.read_text(encoding='utf-8') == 'mine'


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--parameter', 'dark_gray_level'), 'did you mean dark_grey_level?'),
        (('--parameter', 'method'), 'method is not a number'),
        (('--range', 'dark_grey_level'), 'NAME=LOW:HIGH'),
        (('--range', 'dark_grey_level=10:x'), 'NAME=LOW:HIGH'),
        (('--range', 'dark_grey_level=10:999'), 'expected 0 to 255'),
        (('--held-out-share', '1'), 'less than 1'),
        (('--held-out-share', '0.5', '--folds', '3'), 'not allowed with'),
        (('--folds', '1'), '2 or more'),
        (('--missed-weight', '-1'), '0 or more'),
        (('--false-alarm-weight', 'nan'), '0 or more'),
        (('--seed', '1.5'), 'a whole number'),
        (('--seconds', '0'), 'more than 0'),
        ((), '--output'),
    ],
)
def test_a_wrong_call_says_what_is_expected(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output = ('-o', 'x.yaml') if arguments else ()
    with pytest.raises(SystemExit) as ended:
        tune('bag', *output, *arguments)
    assert ended.value.code == 2
    assert words in capsys.readouterr().err


@needs_tune
def test_a_range_of_what_is_not_tuned_is_a_wrong_call(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as ended:
        tune('bag', '-o', 'x.yaml', '--parameter', 'P1', '--range', 'prefilter_cap=10:60')
    assert ended.value.code == 2
    assert 'add --parameter prefilter_cap' in capsys.readouterr().err
