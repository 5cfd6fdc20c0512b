"""Spread and quantiles of noisy values, which outliers do not distort."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

_DEVIATION_PER_MEDIAN = 1.4826
"""Standard deviation of normal values over their median absolute value."""


def robust_spread(values: NDArray[Any]) -> float:
    """Estimate the standard deviation of values around 0 from the median of their magnitudes.

    Parameters
    ----------
    values : ndarray of any number type and shape

    Returns
    -------
    float
        In the unit of the values; 0 where there are none.
    """
    if not values.size:
        return 0.0
    return _DEVIATION_PER_MEDIAN * quantile(np.abs(values), 0.5)


def quantile(values: NDArray[Any], share: float) -> float:
    """Compute what `np.quantile` does, several times faster.

    Parameters
    ----------
    values : ndarray of any number type and shape, not empty, without NaN
    share : float
        0 to 1.
    """
    place = share * (values.size - 1)
    below = math.floor(place)
    # Only with a single index does NumPy partition in vector registers.
    ordered = np.partition(values, below, axis=None)
    lower = float(ordered[below])
    upper = float(ordered[below + 1 :].min()) if place > below else lower
    return lower + (place - below) * (upper - lower)
