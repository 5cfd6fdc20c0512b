"""Statistics of each region, and which regions are seeds (study, section 4.2 step 5)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def region_means(regions: NDArray[np.int32], values: NDArray[Any]) -> NDArray[np.float64]:
    """Average values over each region.

    Parameters
    ----------
    regions : ndarray of int32, shape (height, width)
        1 and up.
    values : ndarray, shape (height, width)

    Returns
    -------
    ndarray of float64, shape (regions + 1,)
        Entry 0 is unused.
    """
    flat = regions.ravel()
    return np.bincount(flat, weights=values.ravel()) / np.maximum(np.bincount(flat), 1)


def seed_regions(
    regions: NDArray[np.int32], has_point: NDArray[np.bool_], min_seed_points: int
) -> NDArray[np.bool_]:
    """Find the regions with enough 3D points to be judged by them.

    Parameters
    ----------
    regions : ndarray of int32, shape (height, width)
        1 and up.
    has_point : ndarray of bool, shape (height, width)
    min_seed_points : int
        Fewest points of a seed region (T1).

    Returns
    -------
    ndarray of bool, shape (regions + 1,)
        Entry 0 is unused.
    """
    points = np.bincount(regions[has_point], minlength=int(regions.max()) + 1)
    return points >= min_seed_points
