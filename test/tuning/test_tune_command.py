"""``rover-obstacles tune`` from the command line."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from pathlib import Path

import pytest
from labelled import write_labelled

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.cli.tune_command import DESCRIPTION
from rover_obstacle_detection.parameter_file import load_config

ROOT = Path(__file__).parents[2]
SMALL_BAGS = sorted((ROOT / 'bags').glob('simulated_*'))
TUNING = 'rover_obstacle_detection.tuning'

needs_tune = pytest.mark.skipif(
    importlib.util.find_spec('optuna') is None, reason='needs the extra tune'
)


@pytest.fixture
def bags(tmp_path: Path) -> list[Path]:
    return [write_labelled(tmp_path / f'day{number}') for number in range(3)]


def tune(*arguments: object) -> int:
    return main(['tune', *map(str, arguments)])


@needs_tune
def test_tuning_small_bags_end_to_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, figures = tmp_path / 'tuned.yaml', tmp_path / 'tuned.json'
    arguments = (*SMALL_BAGS, '--trials', 2, '--set', 'max_step=0.12', '--json', figures)
    assert tune(*arguments, '-o', file) == 0
    shown = capsys.readouterr()
    content = json.loads(figures.read_text(encoding='utf-8'))
    assert content['format'] == 'rover_obstacle_detection tune'
    assert len(content['trials']) == 2
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
def test_which_images_are_rectified_can_be_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bent = write_labelled(tmp_path / 'bent', distortion=(-0.2, 0.05, 0, 0, 0))
    arguments = (bent, '--trials', 1, '--force', '-o', tmp_path / 'x.yaml')
    for rectify in ('always', 'by_name'):
        assert tune(*arguments, '--rectify', rectify) == 0
        said = 'are raw images: rectifying them' in capsys.readouterr().err
        assert said == (rectify == 'always')


@needs_tune
def test_single_bag_has_no_held_out_figures(
    bags: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = tmp_path / 'tuned.json'
    assert tune(bags[0], '--trials', 2, '-o', tmp_path / 'x.yaml', '--json', figures) == 0
    content = json.loads(figures.read_text(encoding='utf-8'))
    assert content['held_out'] is None
    assert content['held_out_reason'] == 'only one bag given'
    assert 'eld out,' not in capsys.readouterr().out


@needs_tune
def test_cross_validation(
    bags: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = tmp_path / 'tuned.json'
    arguments = ('--trials', 2, '--folds', 3, '-o', tmp_path / 'x.yaml', '--json', figures)
    assert tune(*bags, *arguments) == 0
    content = json.loads(figures.read_text(encoding='utf-8'))
    assert content['tuned_on']['tuned']['scenes'] == content['held_out']['tuned']['scenes'] == 3
    assert [len(fold['tuned_on']) for fold in content['folds']] == [2, 2, 2]
    assert 'from a search without it' in capsys.readouterr().out


@needs_tune
def test_worse_held_out_score_warns_and_still_writes_the_file(
    bags: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from rover_obstacle_detection.evaluation.figures import Figures

    def figures_of(config, scene):
        missed = config.dark_grey_level if scene.name == 'day2' else 255 - config.dark_grey_level
        return Figures(frames=1, true_positives=300 - missed, false_negatives=missed)

    monkeypatch.setattr('rover_obstacle_detection.tuning.tune.figures_of', figures_of)
    file = tmp_path / 'tuned.yaml'
    study = ('--set', 'method=study', '--parameter', 'dark_grey_level')
    assert tune(*bags, '--held-out', bags[2], '-o', file, *study) == 0
    assert load_config(file).dark_grey_level > 50
    error = capsys.readouterr().err
    assert 'WARNING: On the held-out bags the tuned parameters are worse' in error


@needs_tune
def test_ctrl_c_writes_the_best_parameters_found(
    bags: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from rover_obstacle_detection.tuning.tune import figures_of

    calls = []

    def interrupted(config, scene):
        calls.append(config)
        if len(calls) == 7:
            raise KeyboardInterrupt
        return figures_of(config, scene)

    monkeypatch.setattr('rover_obstacle_detection.tuning.tune.figures_of', interrupted)
    file = tmp_path / 'tuned.yaml'
    assert tune(*bags, '--held-out-share', 0.4, '-o', file) == 0
    assert 'interrupted after 3 trials' in capsys.readouterr().out
    assert load_config(file)


@needs_tune
def test_tuning_a_rover_limit_warns(
    bags: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert tune(*bags, '--parameter', 'max_step', '--trials', 1, '-o', tmp_path / 'x.yaml') == 0
    assert 'WARNING: max_step is a limit of the rover' in capsys.readouterr().err
    assert load_config(tmp_path / 'x.yaml') == DetectorConfig()


@pytest.fixture
def no_optuna(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith(TUNING)]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, 'optuna', None)


@pytest.mark.usefixtures('no_optuna')
def test_missing_optuna_is_reported_before_any_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert tune(tmp_path / 'nowhere', '-o', tmp_path / 'x.yaml') == 1
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert 'pip install optuna' in error


@pytest.mark.usefixtures('no_optuna')
def test_help_works_without_optuna(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        tune('--help')
    assert ended.value.code == 0
    assert '--held-out' in capsys.readouterr().out


def test_only_the_command_imports_tuning_and_lazily() -> None:
    importing = {
        str(path.relative_to(ROOT)): path.read_text(encoding='utf-8')
        for path in (ROOT / 'rover_obstacle_detection').rglob('*.py')
        if path.parent.name != 'tuning' and TUNING in path.read_text(encoding='utf-8')
    }
    command = importing.pop('rover_obstacle_detection/cli/tune_command.py')
    assert not importing
    assert not re.search(rf'^(from|import) {TUNING}', command, re.MULTILINE)


@needs_tune
def test_help_lists_the_default_parameters() -> None:
    from rover_obstacle_detection.tuning.space import TUNED_BY_DEFAULT

    listed = DESCRIPTION.partition('tuned by default:')[2].replace(',', ' ').split()
    assert listed == list(TUNED_BY_DEFAULT)


@needs_tune
@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--set', 'method=study'), 'name those of study with --parameter'),
        (('--memory', '1', '--folds', '4'), 'cannot be divided into 4 folds'),
        (('--labels-topic', '/nowhere'), 'topic /nowhere is missing'),
    ],
)
def test_errors_are_one_line(
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
def test_existing_file_is_kept_without_force(
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
        (('--range', 'dark_grey_level'), 'NAME=LOW:HIGH'),
        (('--range', 'dark_grey_level=10:x'), 'NAME=LOW:HIGH'),
        (('--held-out-share', '1'), 'less than 1'),
        (('--held-out-share', '0.5', '--folds', '3'), 'not allowed with'),
        (('--folds', '1'), '2 or more'),
        (('--missed-weight', '-1'), '0 or more'),
        (('--false-alarm-weight', 'nan'), '0 or more'),
        (('--seed', '1.5'), 'a whole number'),
        (('--seconds', '0'), 'above 0'),
        ((), '--output'),
    ],
)
def test_usage_error_names_what_is_expected(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output = ('-o', 'x.yaml') if arguments else ()
    with pytest.raises(SystemExit) as ended:
        tune('bag', *output, *arguments)
    assert ended.value.code == 2
    assert words in capsys.readouterr().err


@needs_tune
@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--parameter', 'dark_gray_level'), 'did you mean dark_grey_level?'),
        (('--parameter', 'method'), 'method is not a number'),
        (('--range', 'dark_grey_level=10:80'), 'add --parameter dark_grey_level'),
        (('--range', 'speckle_size=10:-9'), 'speckle_size is -9: expected'),
        (
            ('--parameter', 'max_step', '--parameter', 'dark_grey_level'),
            'method hybrid does not read dark_grey_level',
        ),
        (
            ('--set', 'method=study', '--parameter', 'core_noises'),
            'method study does not read core_noises',
        ),
    ],
)
def test_invalid_search_space_is_a_usage_error(
    arguments: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        tune('bag', '-o', 'x.yaml', *arguments)
    assert ended.value.code == 2
    assert words in capsys.readouterr().err
