"""Spread of noisy values that outliers do not distort."""

from __future__ import annotations

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
    return _DEVIATION_PER_MEDIAN * float(np.median(np.abs(values)))
