"""Search space: the tuned parameters and their ranges, as Optuna distributions."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Mapping
from typing import Any

from optuna.distributions import FloatDistribution, IntDistribution

from rover_obstacle_detection.detection.config import METHODS, DetectorConfig, ParameterDescription
from rover_obstacle_detection.errors import ConfigurationError

Bounds = tuple[float, float]
Ranges = Mapping[str, Any]
"""Optuna distribution of each tuned parameter, by name."""

TUNED_BY_DEFAULT: Mapping[str, Bounds] = {
    'core_share': (0.6, 1.3),
    'core_noises': (0.0, 4.0),
    'outline_probability': (0.2, 0.8),
    'smoothness': (0.3, 3.0),
    'correlation_window_size': (3, 7),
    'uniqueness_ratio': (0, 25),
    'speckle_size': (10, 250),
}
"""Parameters of ``hybrid`` that affect the score, each with the useful part of its range."""

ROVER_LIMITS = frozenset({'max_step', 'max_slope', 'max_roughness', 'min_range', 'max_range'})
"""Properties of the rover. Labels cannot show a better value."""

SIGNIFICANT_DIGITS = 4
"""Digits of a tuned value in the parameter file."""

LOG_RATIO = 10
"""A range that spans this factor is sampled on a logarithmic scale."""


def search_ranges(
    names: Collection[str] = (), bounds: Mapping[str, Bounds] | None = None
) -> Ranges:
    """Return the distribution of every tuned parameter.

    Parameters
    ----------
    names : collection of str
        Parameters to tune; `TUNED_BY_DEFAULT` if empty.
    bounds : mapping of str to tuple of float, optional
        Lowest and highest value, where they differ from the default range.

    Raises
    ------
    ConfigurationError
        As `search_range`, or if `bounds` names a parameter that is not tuned.
    """
    bounds = bounds or {}
    chosen = dict.fromkeys(names or TUNED_BY_DEFAULT)
    for name in bounds:
        if name not in chosen:
            msg = f'--range {name}: {name} is not tuned: add --parameter {name}'
            raise ConfigurationError(msg)
    return {name: search_range(name, bounds.get(name)) for name in chosen}


def search_range(name: str, bounds: Bounds | None = None) -> Any:
    """Return the distribution of one parameter.

    Parameters
    ----------
    name : str
    bounds : tuple of float, optional
        Lowest and highest value. Default: those of `TUNED_BY_DEFAULT`, else the allowed range.

    Returns
    -------
    optuna.distributions.IntDistribution or FloatDistribution

    Raises
    ------
    ConfigurationError
        If the parameter is unknown or not a number, or the bounds are missing or not allowed.
    """
    description = _numeric_parameter(name)
    low, high = bounds or TUNED_BY_DEFAULT.get(name) or _allowed(description)
    if not (math.isfinite(low) and math.isfinite(high)):
        msg = f'{name} has no finite range: give --range {name}=LOW:HIGH'
        raise ConfigurationError(msg)
    whole = isinstance(description.default, int)
    if whole and low == int(low) and high == int(high):
        low, high = int(low), int(high)
    for value in (low, high):
        description.check(value)
    if low >= high:
        msg = f'{name} from {low:g} to {high:g} leaves nothing to choose'
        raise ConfigurationError(msg)
    log = description.step is None and low > 0 and high >= LOG_RATIO * low
    if whole:
        return IntDistribution(low, high, log=log, step=description.step or 1)
    return FloatDistribution(low, high, log=log)


def check_read_by(method: str, names: Collection[str]) -> None:
    """Check that a method reads the parameters. Tuning others would change nothing.

    Parameters
    ----------
    method : str
    names : collection of str
        Names of `DetectorConfig` fields.

    Raises
    ------
    ConfigurationError
        Naming a parameter that only the other method reads.
    """
    others = tuple(f'Method {other}' for other in METHODS if other != method)
    for each in DetectorConfig.parameters():
        if each.name in names and each.description.startswith(others):
            msg = f'method {method} does not read {each.name}: choose another parameter'
            raise ConfigurationError(f'{msg} or set another method')


def start_value(config: DetectorConfig, name: str) -> float:
    """Return the value of a parameter in effect, with automatic values resolved."""
    value: float = config.block_size if name == 'correlation_window_size' else vars(config)[name]
    return value


def rounded(value: float, distribution: Any) -> float:
    """Round a sampled value to a few digits, within its range."""
    if isinstance(distribution, IntDistribution):
        return value
    short = float(f'{value:.{SIGNIFICANT_DIGITS}g}')
    return float(min(max(short, distribution.low), distribution.high))


def range_text(distribution: Any) -> str:
    """Describe a range, such as ``10 to 250, log``."""
    step = distribution.step or 1
    scale = ', log' if distribution.log else f', steps of {step}' if step > 1 else ''
    return f'{distribution.low:g} to {distribution.high:g}{scale}'


def _allowed(description: ParameterDescription) -> Bounds:
    low, high = description.minimum, description.maximum
    return -math.inf if low is None else low, math.inf if high is None else high


def _numeric_parameter(name: str) -> ParameterDescription:
    descriptions = {each.name: each for each in DetectorConfig.parameters()}
    if name not in descriptions:
        near = difflib.get_close_matches(name, descriptions, n=1)
        hint = f'did you mean {near[0]}?' if near else f'expected one of {", ".join(descriptions)}'
        msg = f'{name!r} is not a detector parameter: {hint}'
        raise ConfigurationError(msg)
    description = descriptions[name]
    if isinstance(description.default, (bool, str)):
        msg = f'{name} is not a number: only numbers can be tuned'
        raise ConfigurationError(msg)
    return description
