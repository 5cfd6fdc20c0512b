"""Parameters learned from labelled recordings, and what they do on others."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.evaluation.figures import Figures
from rover_obstacle_detection.evaluation.objective import score_of
from rover_obstacle_detection.evaluation.weights import Weights
from rover_obstacle_detection.offline.evaluate import OnBagProgress, OnProgress
from rover_obstacle_detection.tuning.sampler import Sampler
from rover_obstacle_detection.tuning.scenes import TuningScene, figures_of
from rover_obstacle_detection.tuning.space import SearchRange

ALL_TRIALS = 'all trials done'
TIME_IS_UP = 'time is up'
INTERRUPTED = 'interrupted'


@dataclass(frozen=True)
class TuneOptions:
    """How to search.

    Parameters
    ----------
    ranges : sequence of SearchRange
    weights : Weights
    trials : int
        Sets of parameters to try, that to start from included.
    seconds : float, optional
        No trial begins after this.
    seed : int
    """

    ranges: Sequence[SearchRange]
    weights: Weights = field(default_factory=Weights)
    trials: int = 60
    seconds: float | None = None
    seed: int = 0


@dataclass(frozen=True)
class Trial:
    """One set of parameters and what came of it.

    Parameters
    ----------
    config : DetectorConfig
    figures : tuple of Figures
        Of each scene.
    score : float
    seconds : float
    """

    config: DetectorConfig
    figures: tuple[Figures, ...]
    score: float
    seconds: float


@dataclass(frozen=True)
class Tuning:
    """One search; its first trial are the parameters that it started from.

    Parameters
    ----------
    scenes : tuple of str
    trials : tuple of Trial
    ended : str
        Why it ended.
    """

    scenes: tuple[str, ...]
    trials: tuple[Trial, ...]
    ended: str

    @property
    def start(self) -> Trial:
        """The parameters that it started from."""
        return self.trials[0]

    @property
    def best(self) -> Trial:
        """The first with the highest score: the start, unless another is really better."""
        return max(self.trials, key=lambda trial: trial.score)


@dataclass(frozen=True)
class Comparison:
    """The same scenes with the parameters at the start, and with tuned ones.

    Parameters
    ----------
    scenes : tuple of str
    before, after : tuple of Figures
    """

    scenes: tuple[str, ...]
    before: tuple[Figures, ...]
    after: tuple[Figures, ...]

    def gain(self, weights: Weights) -> float:
        """By how much the score is higher after."""
        return score_of(self.after, weights) - score_of(self.before, weights)

    def scene_gains(self, weights: Weights) -> tuple[float, ...]:
        """By how much the score of each scene is higher after."""
        return tuple(
            score_of([after], weights) - score_of([before], weights)
            for before, after in zip(self.before, self.after, strict=True)
        )


@dataclass(frozen=True)
class TuningResult:
    """What was learned, and how it does on what it was not learned from.

    Parameters
    ----------
    tuning : Tuning
        The search that the parameters come from.
    held_out : Comparison, optional
        Scenes that the tuned parameters of the comparison have not seen.
    reason : str
        How the held-out scenes were chosen, or why there are none.
    folds : tuple of Tuning
        Of each fold, the search without it, whose parameters `held_out` is about.
    """

    tuning: Tuning
    held_out: Comparison | None
    reason: str
    folds: tuple[Tuning, ...] = ()

    @property
    def tuned(self) -> Comparison:
        """The scenes that the parameters were tuned on."""
        return Comparison(self.tuning.scenes, self.tuning.start.figures, self.tuning.best.figures)


def tune(
    scenes: Sequence[TuningScene],
    start: DetectorConfig,
    options: TuneOptions,
    on_progress: OnProgress,
    clock: Callable[[], float] = time.monotonic,
) -> Tuning:
    """Search for the parameters with the highest score.

    Ctrl-C ends the search and keeps what it has found, once the start has been looked at.

    Parameters
    ----------
    scenes : sequence of TuningScene
    start : DetectorConfig
        Tried first, so that the result is never worse on these scenes.
    options : TuneOptions
    on_progress : callable
        Told the trials done, and their number.
    clock : callable, optional
        Seconds.

    Raises
    ------
    ConfigurationError
        If there are no obstacles in the scenes, or no values in the ranges are allowed.
    MissingExtraError
        If the optimiser is not installed.
    """
    if not any(scene.has_obstacles for scene in scenes):
        names = ', '.join(scene.name for scene in scenes)
        msg = f'{names}: no obstacle to tune on: the best detector would be blind'
        raise ConfigurationError(msg)
    sampler = Sampler(start, options.ranges, options.seed)
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
            config = sampler.ask() if trials else start
            if config not in known:
                known[config] = tuple(figures_of(config, scene) for scene in scenes)
            score = score_of(known[config], options.weights)
            trials.append(Trial(config, known[config], score, clock() - started_s))
            sampler.tell(score)
            on_progress(len(trials), options.trials)
    except KeyboardInterrupt:
        if not trials:
            raise
        ended = INTERRUPTED
    return Tuning(tuple(scene.name for scene in scenes), tuple(trials), ended)


def tune_and_hold_out(
    scenes: Sequence[TuningScene],
    held_out: Sequence[TuningScene],
    reason: str,
    start: DetectorConfig,
    options: TuneOptions,
    on_progress: OnBagProgress,
) -> TuningResult:
    """Tune on some scenes, and look at the others with what came out."""
    tuning = tune(scenes, start, options, functools.partial(on_progress, 0))
    if not held_out:
        return TuningResult(tuning, None, reason)
    return TuningResult(tuning, _compared(held_out, start, tuning.best.config), reason)


def tune_in_folds(
    scenes: Sequence[TuningScene],
    folds: Sequence[Sequence[TuningScene]],
    start: DetectorConfig,
    options: TuneOptions,
    on_progress: OnBagProgress,
) -> TuningResult:
    """Tune on all scenes; then, for each fold, on the others, and look at the fold with that.

    The time is shared out evenly. A fold whose search is interrupted ends it all, and is left out.
    """
    if options.seconds:
        options = replace(options, seconds=options.seconds / (1 + len(folds)))
    tuning = tune(scenes, start, options, functools.partial(on_progress, 0))
    searches: list[Tuning] = []
    parts: list[Comparison] = []
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
        parts.append(_compared(fold, start, search.best.config))
    reason = f'{len(searches)} of {len(folds)} folds, seed {options.seed}'
    return TuningResult(tuning, _joined(parts), reason, tuple(searches))


def _compared(
    scenes: Sequence[TuningScene], start: DetectorConfig, best: DetectorConfig
) -> Comparison:
    before = tuple(figures_of(start, scene) for scene in scenes)
    after = before if best == start else tuple(figures_of(best, scene) for scene in scenes)
    return Comparison(tuple(scene.name for scene in scenes), before, after)


def _joined(parts: Iterable[Comparison]) -> Comparison | None:
    parts = list(parts)
    if not parts:
        return None
    return Comparison(
        tuple(name for part in parts for name in part.scenes),
        tuple(figures for part in parts for figures in part.before),
        tuple(figures for part in parts for figures in part.after),
    )
