"""Which parameters are tuned, and between what values."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from rover_obstacle_detection.detection.config import DetectorConfig, ParameterDescription
from rover_obstacle_detection.errors import ConfigurationError

Bounds = tuple[float, float]

TUNED_BY_DEFAULT: Mapping[str, Bounds] = {
    'core_share': (0.6, 1.3),
    'core_noises': (0.0, 4.0),
    'outline_probability': (0.2, 0.8),
    'smoothness': (0.3, 3.0),
    'correlation_window_size': (3, 7),
    'uniqueness_ratio': (0, 25),
    'speckle_size': (10, 250),
}
"""What decides in the method ``hybrid``, and where it is worth looking: less than allowed."""

ROVER_LIMITS = frozenset({'max_step', 'max_slope', 'max_roughness', 'min_range', 'max_range'})
"""What the rover can do or its owner wants; a score against labels says nothing about it."""

SIGNIFICANT_DIGITS = 4
LOG_RATIO = 10


@dataclass(frozen=True)
class SearchRange:
    """The values of one parameter that are tried.

    Parameters
    ----------
    name : str
    low, high : float
        Both included.
    is_whole : bool
        Whether it takes whole numbers only.
    step : int, optional
        From `low` on, where not every whole number is allowed.
    """

    name: str
    low: float
    high: float
    is_whole: bool = False
    step: int | None = None

    @property
    def is_log(self) -> bool:
        """Whether ratios count and not differences: where it spans a decade or more."""
        return self.step is None and self.low > 0 and self.high >= LOG_RATIO * self.low

    def contains(self, value: float) -> bool:
        """Tell whether a value could be tried."""
        on_step = self.step is None or (value - self.low) % self.step == 0
        return self.low <= value <= self.high and on_step

    def value_in(self, config: DetectorConfig) -> float:
        """Return the value of a configuration."""
        if self.name == 'correlation_window_size':
            return config.block_size
        value: float = getattr(config, self.name)
        return value

    def rounded(self, value: float) -> float:
        """Round to what a person would write into a file, without leaving the range."""
        if self.is_whole:
            return int(value)
        short = float(f'{value:.{SIGNIFICANT_DIGITS}g}')
        return min(max(short, self.low), self.high)

    def __str__(self) -> str:
        steps = f', steps of {self.step}' if self.step else ''
        return f'{self.low:g} to {self.high:g}{", log" if self.is_log else steps}'


def search_range(name: str, bounds: Bounds | None = None) -> SearchRange:
    """Make the range of one parameter.

    Parameters
    ----------
    name : str
    bounds : tuple of float, optional
        Lowest and highest value; if not given, those of `TUNED_BY_DEFAULT`, or all that are
        allowed.

    Raises
    ------
    ConfigurationError
        If there is no such parameter, it is no number, or the bounds are not known or not allowed.
    """
    description = _numeric_parameter(name)
    low, high = bounds or TUNED_BY_DEFAULT.get(name) or _allowed(description)
    if not (math.isfinite(low) and math.isfinite(high)):
        msg = f'{name} has no smallest and largest value: give --range {name}=LOW:HIGH'
        raise ConfigurationError(msg)
    is_whole = isinstance(description.default, int)
    if is_whole and low == int(low) and high == int(high):
        low, high = int(low), int(high)
    for value in (low, high):
        description.check(value)
    if low >= high:
        msg = f'{name} from {low:g} to {high:g} leaves nothing to choose'
        raise ConfigurationError(msg)
    return SearchRange(name, low, high, is_whole, description.step)


def search_ranges(
    names: Iterable[str] = (), bounds: Mapping[str, Bounds] | None = None
) -> tuple[SearchRange, ...]:
    """Make the ranges of all that is tuned.

    Parameters
    ----------
    names : iterable of str
        `TUNED_BY_DEFAULT` if empty.
    bounds : mapping of str to tuple of float, optional
        Of those that are not to be searched as usual.

    Raises
    ------
    ConfigurationError
        As for `search_range`, or if there are bounds of what is not tuned.
    """
    bounds = bounds or {}
    chosen = tuple(dict.fromkeys(names)) or tuple(TUNED_BY_DEFAULT)
    for name in bounds:
        if name not in chosen:
            msg = f'--range {name} is given, but {name} is not tuned: add --parameter {name}'
            raise ConfigurationError(msg)
    return tuple(search_range(name, bounds.get(name)) for name in chosen)


def _allowed(description: ParameterDescription) -> Bounds:
    low, high = description.minimum, description.maximum
    return -math.inf if low is None else low, math.inf if high is None else high


def _numeric_parameter(name: str) -> ParameterDescription:
    descriptions = {each.name: each for each in DetectorConfig.parameters()}
    if name not in descriptions:
        near = difflib.get_close_matches(name, descriptions, n=1)
        hint = f'did you mean {near[0]}?' if near else f'expected one of {", ".join(descriptions)}'
        msg = f'{name!r} is not a parameter of the detector: {hint}'
        raise ConfigurationError(msg)
    description = descriptions[name]
    if isinstance(description.default, (bool, str)):
        msg = f'{name} is not a number: only numbers can be tuned'
        raise ConfigurationError(msg)
    return description
