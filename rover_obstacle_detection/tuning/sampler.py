"""Values to try next: Optuna's tree-structured Parzen estimator (Bergstra et al. 2011).

Made for what takes seconds a trial and is noisy or stepped, with few dozen trials for some ten
parameters, whole numbers among them, where evolution strategies need hundreds.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import ConfigurationError, MissingExtraError
from rover_obstacle_detection.tuning.space import SearchRange

ENOUGH_QUESTIONS = 200


class Sampler:
    """Asked for parameters, and told the score of each in turn; first that of the start.

    The same seed and the same scores give the same parameters.

    Parameters
    ----------
    start : DetectorConfig
    ranges : sequence of SearchRange
    seed : int

    Raises
    ------
    MissingExtraError
        If Optuna is not installed.
    """

    def __init__(self, start: DetectorConfig, ranges: Sequence[SearchRange], seed: int) -> None:
        self._optuna = tuning_library()
        self._optuna.logging.set_verbosity(self._optuna.logging.WARNING)
        self._start = start
        self._ranges = ranges
        self._distributions = {each.name: self._distribution(each) for each in ranges}
        self._study = self._optuna.create_study(
            direction='maximize', sampler=self._optuna.samplers.TPESampler(seed=seed)
        )
        self._asked: Any = None

    def ask(self) -> DetectorConfig:
        """Choose parameters to try, of which none contradicts another.

        Raises
        ------
        ConfigurationError
            If there seem to be none.
        """
        for _ in range(ENOUGH_QUESTIONS):
            self._asked = self._study.ask(self._distributions)
            values = {
                each.name: each.rounded(self._asked.params[each.name]) for each in self._ranges
            }
            try:
                return replace(self._start, **values)  # type: ignore[arg-type]
            except ConfigurationError as error:
                self._study.tell(self._asked, state=self._optuna.trial.TrialState.PRUNED)
                reason = str(error)
        msg = f'no parameters to try: {reason}'
        raise ConfigurationError(msg)

    def tell(self, score: float) -> None:
        """Tell the score of the parameters asked for last; before that, of the start."""
        if self._asked is not None:
            self._study.tell(self._asked, score)
            return
        values = {each.name: each.value_in(self._start) for each in self._ranges}
        # What lies outside the ranges the optimiser cannot learn from.
        if all(each.contains(values[each.name]) for each in self._ranges):
            self._study.add_trial(
                self._optuna.trial.create_trial(
                    params=values, distributions=self._distributions, value=score
                )
            )

    def _distribution(self, parameter: SearchRange) -> Any:
        low, high, is_log = parameter.low, parameter.high, parameter.is_log
        distributions = self._optuna.distributions
        if parameter.is_whole:
            return distributions.IntDistribution(low, high, log=is_log, step=parameter.step or 1)
        return distributions.FloatDistribution(low, high, log=is_log)


def tuning_library() -> Any:
    """Import Optuna.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return importlib.import_module('optuna')
    except ImportError as error:
        msg = (
            'tuning needs optuna, which is not installed: '
            "pip install 'rover_obstacle_detection[tune]'"
        )
        raise MissingExtraError(msg) from error
