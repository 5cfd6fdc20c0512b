"""Figures of each region, and which regions are seeds (study, section 4.2 step 5)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def region_sizes(regions: NDArray[np.int32]) -> NDArray[np.int64]:
    """Pixels of each region; entry 0 is unused."""
    return np.bincount(regions.ravel())


def region_counts(regions: NDArray[np.int32], where: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Pixels of each region at which ``where`` holds; entry 0 is unused."""
    return np.bincount(regions[where], minlength=int(regions.max()) + 1)


def region_means(regions: NDArray[np.int32], values: NDArray[Any]) -> NDArray[np.float64]:
    """Mean of ``values`` over each region; entry 0 is unused."""
    sums = np.bincount(regions.ravel(), weights=values.ravel())
    return sums / np.maximum(region_sizes(regions), 1)


def seed_regions(
    regions: NDArray[np.int32], has_point: NDArray[np.bool_], min_seed_points: int
) -> NDArray[np.bool_]:
    """Tell which regions have enough 3D points to be judged by them.

    Parameters
    ----------
    regions : ndarray of int32, shape (height, width)
        1 and up.
    has_point : ndarray of bool, shape (height, width)
    min_seed_points : int
        T1: so many points or more.

    Returns
    -------
    ndarray of bool, shape (regions + 1,)
        Entry 0 is unused.
    """
    return region_counts(regions, has_point) >= min_seed_points


def region_shares(
    regions: NDArray[np.int32], hit: NDArray[np.bool_], judged: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Share of each region's judged pixels that are hits; 0 where none is judged."""
    points = region_counts(regions, judged)
    return region_counts(regions, hit & judged) / np.maximum(points, 1)
