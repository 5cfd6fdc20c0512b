"""The parameter search: its result, repeatability, early ends, and held-out comparison."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from labelled import SHAPE, labels, write_labelled

from rover_obstacle_detection import Detector, DetectorConfig
from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.errors import ConfigurationError, UnjudgeablePairError
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics
from rover_obstacle_detection.parameter_file import load_config

pytest.importorskip('optuna', reason='needs the extra tune')
from rover_obstacle_detection.tuning import tune as module
from rover_obstacle_detection.tuning.report import (
    BETTER,
    WORSE,
    conclusion,
    parameter_file,
    verdict,
)
from rover_obstacle_detection.tuning.scenes import TuningScene, figures_of, read_scenes
from rover_obstacle_detection.tuning.space import search_ranges
from rover_obstacle_detection.tuning.tune import (
    ALL_TRIALS,
    INTERRUPTED,
    TIME_IS_UP,
    TuneOptions,
    Tuning,
    tune,
    tune_and_hold_out,
    tune_in_folds,
)

GREY = TuneOptions(search_ranges(['dark_grey_level', 'uniqueness_ratio']), trials=12)
START = DetectorConfig()
BAG = BagOptions()
PLENTY_BYTES = 10**9


def scene(name: str = 'noon', array: np.ndarray | None = None) -> TuningScene:
    truth = labels() if array is None else array
    image = np.zeros(SHAPE, np.uint8)
    frame = LabelledFrame(0, None, image, image, truth, np.zeros(SHAPE, np.uint16))
    return TuningScene(name, Path(name), (frame,))


def peak_at(level: int) -> Callable[[DetectorConfig, TuningScene], Figures]:
    """Fake figures whose IoU is highest at one grey level."""

    def figures(config: DetectorConfig, scene: TuningScene) -> Figures:
        missed = abs(config.dark_grey_level - level)
        return Figures(frames=1, true_positives=1000 - missed, false_negatives=missed)

    return figures


def by_scene(
    levels: dict[str, int],
) -> Callable[[DetectorConfig, TuningScene], Figures]:
    return lambda config, scene: peak_at(levels[scene.name])(config, scene)


def ignored(*_: int) -> None:
    pass


def search(options: TuneOptions = GREY, **given) -> Tuning:
    return tune([scene()], START, options, ignored, **given)


@pytest.fixture
def _peak(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, 'figures_of', peak_at(90))


@pytest.mark.usefixtures('_peak')
def test_search_improves_on_the_start() -> None:
    tuning = search(replace(GREY, trials=40))
    assert len(tuning.trials) == 40
    assert tuning.ended == ALL_TRIALS
    assert tuning.start.config == START
    assert tuning.best.score > tuning.start.score
    assert abs(tuning.best.config.dark_grey_level - 90) <= 10
    changed = {
        name
        for name in vars(START)
        for trial in tuning.trials
        if getattr(trial.config, name) != getattr(START, name)
    }
    assert changed == {'dark_grey_level', 'uniqueness_ratio'}


@pytest.mark.usefixtures('_peak')
def test_equal_seeds_give_equal_trials() -> None:
    first, second = (search().trials for _ in range(2))
    other = search(replace(GREY, seed=1)).trials
    assert [each.config for each in first] == [each.config for each in second]
    assert [each.config for each in first] != [each.config for each in other]


def test_start_is_kept_if_no_trial_is_better(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, 'figures_of', peak_at(START.dark_grey_level))
    tuning = search()
    assert tuning.best is tuning.start


@pytest.mark.usefixtures('_peak')
def test_no_trial_starts_after_the_time_limit() -> None:
    seconds = itertools.count()
    tuning = search(replace(GREY, seconds=5.0), clock=lambda: float(next(seconds)))
    assert tuning.ended == TIME_IS_UP
    assert 1 <= len(tuning.trials) < GREY.trials


def interrupted_at(call: int):
    calls, figures = itertools.count(1), peak_at(90)

    def figures_or_interrupt(config: DetectorConfig, scene: TuningScene) -> Figures:
        if next(calls) == call:
            raise KeyboardInterrupt
        return figures(config, scene)

    return figures_or_interrupt


def test_ctrl_c_keeps_finished_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, 'figures_of', interrupted_at(6))
    tuning = search()
    assert tuning.ended == INTERRUPTED
    assert len(tuning.trials) == 5


def test_ctrl_c_in_the_first_trial_propagates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, 'figures_of', interrupted_at(1))
    with pytest.raises(KeyboardInterrupt):
        search()


def test_equal_parameters_are_evaluated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    evaluated = []

    def figures(config: DetectorConfig, scene: TuningScene) -> Figures:
        evaluated.append(config)
        return peak_at(90)(config, scene)

    monkeypatch.setattr(module, 'figures_of', figures)
    few = search_ranges(['dark_grey_level'], {'dark_grey_level': (50, 52)})
    tuning = search(TuneOptions(few, trials=12))
    assert len(tuning.trials) == 12
    assert len(evaluated) == len(set(evaluated)) <= 3


@pytest.mark.usefixtures('_peak')
def test_contradictory_parameters_are_not_tried() -> None:
    overlap = search_ranges(['P1', 'P2'], {'P1': (500, 1500), 'P2': (600, 1600)})
    tuning = search(TuneOptions(overlap, trials=20))
    assert len(tuning.trials) == 20
    assert all(trial.config.P1 < trial.config.P2 for trial in tuning.trials[1:])
    never = search_ranges(['P1', 'P2'], {'P1': (900, 1000), 'P2': (300, 400)})
    with pytest.raises(ConfigurationError, match='expected more than P1'):
        search(TuneOptions(never, trials=3))


def test_scenes_without_obstacles_are_refused() -> None:
    with pytest.raises(ConfigurationError, match='moon: no obstacles'):
        tune([scene('moon', np.zeros(SHAPE, np.uint8))], START, GREY, ignored)


@pytest.mark.parametrize(('level', 'word'), [(95, BETTER), (20, WORSE)])
def test_held_out_scenes_decide_the_verdict(
    level: int, word: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module, 'figures_of', by_scene({'noon': 90, 'dusk': level}))
    options = replace(GREY, trials=30)
    result = tune_and_hold_out([scene()], [scene('dusk')], 'by name', START, options, ignored)
    assert verdict(result, options.weights) == word
    sentence = conclusion(result, options.weights)
    assert f'held-out bags the tuned parameters are {word}' in sentence
    assert f'1 {word}' in sentence
    file = tmp_path / 'tuned.yaml'
    file.write_text(parameter_file(result, options), encoding='utf-8')
    assert load_config(file) == result.tuning.best.config
    assert '# Held out (by name): dusk.' in file.read_text(encoding='utf-8')


@pytest.mark.usefixtures('_peak')
def test_conclusion_without_held_out_scenes() -> None:
    result = tune_and_hold_out([scene()], [], 'only one bag given', START, GREY, ignored)
    assert result.held_out is None
    assert verdict(result, GREY.weights) == ''
    sentence = conclusion(result, GREY.weights)
    assert 'no bags were held out (only one bag given)' in sentence


def test_each_fold_is_evaluated_with_parameters_tuned_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    levels = {'a': 20, 'b': 80, 'c': 80, 'd': 80}
    monkeypatch.setattr(module, 'figures_of', by_scene(levels))
    scenes = [scene(name) for name in levels]
    folds = [scenes[:1], scenes[1:]]
    progress = []
    options = replace(GREY, trials=25)
    result = tune_in_folds(scenes, folds, START, options, lambda *update: progress.append(update))
    assert result.tuning.scenes == ('a', 'b', 'c', 'd')
    assert [each.scenes for each in result.folds] == [('b', 'c', 'd'), ('a',)]
    without_a, without_others = (each.best.config.dark_grey_level for each in result.folds)
    assert without_others < 50 < without_a
    assert result.held_out is not None
    assert result.held_out.scenes == ('a', 'b', 'c', 'd')
    assert verdict(result, options.weights) == WORSE
    assert {index for index, _, _ in progress} == {0, 1, 2}


def test_interrupted_folds_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    scenes = [scene(name) for name in 'abc']
    # 12 trials of three scenes, 12 of two, one comparison of one scene, then into fold two.
    monkeypatch.setattr(module, 'figures_of', interrupted_at(12 * 3 + 12 * 2 + 2 + 5))
    result = tune_in_folds(scenes, [[each] for each in scenes], START, GREY, ignored)
    assert result.tuning.ended == ALL_TRIALS
    assert len(result.folds) == 1
    assert result.held_out is not None
    assert result.held_out.scenes == ('a',)
    assert result.reason == '1 of 3 folds, seed 0'


def test_frames_in_memory_give_the_figures_of_the_bag(tmp_path: Path) -> None:
    path = write_labelled(tmp_path / 'noon')
    # Its images show noise: the hybrid refuses them, the study finds them dark.
    config = DetectorConfig(method='study', dark_grey_level=255)
    (kept,) = read_scenes([path], BAG, PLENTY_BYTES, ignored)
    assert kept.name == 'noon'
    assert kept.has_obstacles
    assert kept.memory_bytes == 2 * 5 * SHAPE[0] * SHAPE[1]
    with open_bag(path) as bag:
        frames, _ = labelled_frames(bag, find_truth_topics(bag), BAG)
        expected = Figures()
        for frame in frames:
            mask = Detector(frame.camera, config).detect(frame.left, frame.right).mask
            expected += score(mask, frame.labels, frame.instances)
    assert expected.true_positives > 0
    assert figures_of(config, kept) == expected


def test_pair_that_cannot_be_judged_finds_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise UnjudgeablePairError('both images are black')

    (kept,) = read_scenes([write_labelled(tmp_path / 'bag')], BAG, PLENTY_BYTES, ignored)
    monkeypatch.setattr(Detector, 'detect', refuse)

    figures = figures_of(START, kept)

    assert figures.frames == 2
    assert (figures.true_positives, figures.false_positives) == (0, 0)


def test_memory_limit_is_checked_before_reading_on(tmp_path: Path) -> None:
    path = write_labelled(tmp_path / 'noon', frames=4)
    frame_bytes = 5 * SHAPE[0] * SHAPE[1]
    read = []
    with pytest.raises(ConfigurationError, match=r'4 frames would take .* --every N'):
        read_scenes([path], BAG, 3 * frame_bytes, lambda *update: read.append(update))
    assert not read
    fewer = read_scenes([path], BagOptions(every=2), 3 * frame_bytes, ignored)
    assert len(fewer[0].frames) == 2
