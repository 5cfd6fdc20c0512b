"""Planes by weighted least squares, from the moments of the points around every place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

MIN_WEIGHT = np.float32(1e-9)
_MIN_DETERMINANT = np.float32(1e-9)


@dataclass(frozen=True, eq=False)
class Moments:
    """Weighted sums over the points around every place; all arrays have one shape.

    Parameters
    ----------
    n, u, v, uu, uv, vv : ndarray of float
        Sums of the weight times powers of the offsets u and v.
    h, uh, vh : ndarray of float
        Sums of the weighted height times those.
    """

    n: Array
    u: Array
    v: Array
    uu: Array
    uv: Array
    vv: Array
    h: Array
    uh: Array
    vh: Array


@dataclass(frozen=True, eq=False)
class FittedPlanes:
    """The plane ``h = height + rise_u u + rise_v v`` around every place.

    Parameters
    ----------
    height, rise_u, rise_v : ndarray of float
    variance_u, variance_v, covariance : ndarray of float
        Of the offsets of the points, regularisation included.
    determinant : ndarray of float
        Of their covariance matrix: 0 where all points lie on a line.
    """

    height: Array
    rise_u: Array
    rise_v: Array
    variance_u: Array
    variance_v: Array
    covariance: Array
    determinant: Array


def planes_from_moments(moments: Moments, ridge: float = 0.0) -> FittedPlanes:
    """Fit the planes.

    Parameters
    ----------
    moments : Moments
    ridge : float
        Added to the variances, which regularises planes whose points lie on a line.

    Notes
    -----
    Relative to the mean of the points, the 3 x 3 normal equations become a 2 x 2 system.
    """
    m = moments
    n = np.maximum(m.n, MIN_WEIGHT)
    mean_u, mean_v, mean_h = m.u / n, m.v / n, m.h / n
    added = np.float32(ridge)
    cuu, cvv = m.uu / n - mean_u**2 + added, m.vv / n - mean_v**2 + added
    cuv = m.uv / n - mean_u * mean_v
    cuh, cvh = m.uh / n - mean_u * mean_h, m.vh / n - mean_v * mean_h
    determinant = cuu * cvv - cuv**2
    divisor = np.maximum(determinant, _MIN_DETERMINANT)
    rise_u = (cuh * cvv - cvh * cuv) / divisor
    rise_v = (cvh * cuu - cuh * cuv) / divisor
    height = mean_h - rise_u * mean_u - rise_v * mean_v
    return FittedPlanes(height, rise_u, rise_v, cuu, cvv, cuv, determinant)
