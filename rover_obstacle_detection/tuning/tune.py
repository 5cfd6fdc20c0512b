"""Search for the best parameters, and compare them with the start on held-out recordings."""

from __future__ import annotations

import contextlib
import functools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import optuna

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.objective import score_of
from rover_obstacle_detection.evaluation.weights import Weights
from rover_obstacle_detection.offline.evaluate import OnBagProgress, OnProgress
from rover_obstacle_detection.tuning.scenes import TuningScene, figures_of
from rover_obstacle_detection.tuning.space import Ranges, rounded, start_value

ALL_TRIALS = 'all trials done'
TIME_IS_UP = 'time is up'
INTERRUPTED = 'interrupted'

MAX_DRAWS = 200
"""Samples drawn for one trial before the ranges count as contradictory."""


@dataclass(frozen=True)
class TuneOptions:
    """Settings of a search.

    Parameters
    ----------
    ranges : mapping of str to Optuna distribution
    weights : Weights
    trials : int
        Parameter sets to evaluate, including the start.
    seconds : float, optional
        Start no trial after this time.
    seed : int
    """

    ranges: Ranges
    weights: Weights = field(default_factory=Weights)
    trials: int = 60
    seconds: float | None = None
    seed: int = 0


@dataclass(frozen=True)
class Trial:
    """One evaluated parameter set.

    Parameters
    ----------
    config : DetectorConfig
    figures : tuple of Figures
        One per scene.
    score : float
    seconds : float
        Run time.
    """

    config: DetectorConfig
    figures: tuple[Figures, ...]
    score: float
    seconds: float


@dataclass(frozen=True)
class Tuning:
    """One search.

    Parameters
    ----------
    scenes : tuple of str
    trials : tuple of Trial
        The first is the start.
    ended : str
        `ALL_TRIALS`, `TIME_IS_UP` or `INTERRUPTED`.
    """

    scenes: tuple[str, ...]
    trials: tuple[Trial, ...]
    ended: str

    @property
    def start(self) -> Trial:
        """The trial of the initial parameters."""
        return self.trials[0]

    @property
    def best(self) -> Trial:
        """The trial with the highest score; the earliest on a tie."""
        return max(self.trials, key=lambda trial: trial.score)


@dataclass(frozen=True)
class Comparison:
    """Figures of the same scenes before and after tuning.

    Parameters
    ----------
    scenes : tuple of str
    before, after : tuple of Figures
        One per scene.
    """

    scenes: tuple[str, ...]
    before: tuple[Figures, ...]
    after: tuple[Figures, ...]

    def gain(self, weights: Weights) -> float:
        """Return the increase of the score."""
        return score_of(self.after, weights) - score_of(self.before, weights)

    def scene_gains(self, weights: Weights) -> tuple[float, ...]:
        """Return the increase of the score of each scene."""
        return tuple(
            Comparison((scene,), (before,), (after,)).gain(weights)
            for scene, before, after in zip(self.scenes, self.before, self.after, strict=True)
        )

    def __add__(self, other: Comparison) -> Comparison:
        return Comparison(
            self.scenes + other.scenes, self.before + other.before, self.after + other.after
        )


@dataclass(frozen=True)
class TuningResult:
    """Tuned parameters and their performance on other recordings.

    Parameters
    ----------
    tuning : Tuning
        The search that found the parameters.
    held_out : Comparison, optional
        Scenes not used to find the parameters compared.
    reason : str
        How the held-out scenes were chosen, or why there are none.
    folds : tuple of Tuning
        Cross-validation: the search without each fold. `held_out` compares their parameters.
    """

    tuning: Tuning
    held_out: Comparison | None
    reason: str
    folds: tuple[Tuning, ...] = ()

    @property
    def tuned(self) -> Comparison:
        """Comparison on the scenes used for tuning."""
        return Comparison(self.tuning.scenes, self.tuning.start.figures, self.tuning.best.figures)


def tune(
    scenes: Sequence[TuningScene],
    start: DetectorConfig,
    options: TuneOptions,
    on_progress: OnProgress,
    clock: Callable[[], float] = time.monotonic,
) -> Tuning:
    """Maximise the score with a tree-structured Parzen estimator (Bergstra et al. 2011).

    Equal seeds and scores give equal trials. Ctrl-C ends the search and keeps its trials; during
    the first trial it propagates.

    Parameters
    ----------
    scenes : sequence of TuningScene
    start : DetectorConfig
        Evaluated first, so the result is never worse on these scenes.
    options : TuneOptions
    on_progress : callable
        Called with the trials done and the total.
    clock : callable
        Returns seconds.

    Raises
    ------
    ConfigurationError
        If the scenes have no obstacles, or the ranges hold no valid combination.
    """
    if not any(scene.has_obstacles for scene in scenes):
        names = ', '.join(scene.name for scene in scenes)
        msg = f'{names}: no obstacles, so the best detector would find nothing'
        raise ConfigurationError(msg)
    sampler = optuna.samplers.TPESampler(seed=options.seed)
    study = optuna.create_study(direction='maximize', sampler=sampler)
    known: dict[DetectorConfig, tuple[Figures, ...]] = {}
    trials: list[Trial] = []
    ended = ALL_TRIALS
    began_s = clock()
    try:
        while len(trials) < options.trials:
            started_s = clock()
            if trials and options.seconds and started_s - began_s >= options.seconds:
                ended = TIME_IS_UP
                break
            asked, config = _ask(study, start, options.ranges) if trials else (None, start)
            if config not in known:
                known[config] = tuple(figures_of(config, scene) for scene in scenes)
            score = score_of(known[config], options.weights)
            trials.append(Trial(config, known[config], score, clock() - started_s))
            if asked:
                study.tell(asked, score)
            else:
                _add_start(study, start, options.ranges, score)
            on_progress(len(trials), options.trials)
    except KeyboardInterrupt:
        if not trials:
            raise
        ended = INTERRUPTED
    return Tuning(tuple(scene.name for scene in scenes), tuple(trials), ended)


def _ask(study: Any, start: DetectorConfig, ranges: Ranges) -> tuple[Any, DetectorConfig]:
    """Draw the next valid configuration, with its Optuna trial."""
    for _ in range(MAX_DRAWS):
        asked = study.ask(ranges)
        values = {name: rounded(value, ranges[name]) for name, value in asked.params.items()}
        try:
            return asked, replace(start, **values)  # type: ignore[arg-type]
        except ConfigurationError as error:
            study.tell(asked, state=optuna.trial.TrialState.PRUNED)
            reason = str(error)
    msg = f'no valid parameters in the ranges: {reason}'
    raise ConfigurationError(msg)


def _add_start(study: Any, start: DetectorConfig, ranges: Ranges, score: float) -> None:
    values = {name: start_value(start, name) for name in ranges}
    # Optuna raises ValueError for values outside the ranges: it cannot learn from them.
    with contextlib.suppress(ValueError):
        study.add_trial(
            optuna.trial.create_trial(params=values, distributions=dict(ranges), value=score)
        )


def tune_and_hold_out(
    scenes: Sequence[TuningScene],
    held_out: Sequence[TuningScene],
    reason: str,
    start: DetectorConfig,
    options: TuneOptions,
    on_progress: OnBagProgress,
) -> TuningResult:
    """Tune on `scenes` and evaluate the result on `held_out`."""
    tuning = tune(scenes, start, options, functools.partial(on_progress, 0))
    compared = _compare(held_out, start, tuning.best.config) if held_out else None
    return TuningResult(tuning, compared, reason)


def tune_in_folds(
    scenes: Sequence[TuningScene],
    folds: Sequence[Sequence[TuningScene]],
    start: DetectorConfig,
    options: TuneOptions,
    on_progress: OnBagProgress,
) -> TuningResult:
    """Tune on all scenes, and cross-validate: tune without each fold and evaluate on it.

    The searches share the time evenly. Ctrl-C ends the cross-validation at the last complete fold.
    """
    if options.seconds:
        options = replace(options, seconds=options.seconds / (1 + len(folds)))
    tuning = tune(scenes, start, options, functools.partial(on_progress, 0))
    searches: list[Tuning] = []
    held_out = Comparison((), (), ())
    for index, fold in enumerate(folds, start=1):
        if tuning.ended == INTERRUPTED:
            break
        others = [scene for scene in scenes if scene not in fold]
        try:
            search = tune(others, start, options, functools.partial(on_progress, index))
        except KeyboardInterrupt:
            break
        if search.ended == INTERRUPTED:
            break
        searches.append(search)
        held_out += _compare(fold, start, search.best.config)
    reason = f'{len(searches)} of {len(folds)} folds, seed {options.seed}'
    return TuningResult(tuning, held_out if searches else None, reason, tuple(searches))


def _compare(
    scenes: Sequence[TuningScene], start: DetectorConfig, best: DetectorConfig
) -> Comparison:
    before = tuple(figures_of(start, scene) for scene in scenes)
    after = before if best == start else tuple(figures_of(best, scene) for scene in scenes)
    return Comparison(tuple(scene.name for scene in scenes), before, after)
