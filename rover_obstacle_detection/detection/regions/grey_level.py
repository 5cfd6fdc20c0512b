"""Grey-level rule for regions without enough 3D points (study, section 4.2 step 6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.regions.regions import region_means


def dark_regions(
    grey: NDArray[np.uint8],
    regions: NDArray[np.int32],
    is_seed: NDArray[np.bool_],
    max_grey_level: float,
) -> NDArray[np.bool_]:
    """Find the dark regions among those that are not seeds.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    regions : ndarray of int32, shape (height, width)
        1 and up.
    is_seed : ndarray of bool, shape (regions + 1,)
    max_grey_level : float
        Regions with a lower mean are dark (T4).

    Returns
    -------
    ndarray of bool, shape (regions + 1,)
        Entry 0 is unused and False.
    """
    if is_seed[1:].all():
        return np.zeros_like(is_seed)
    dark = ~is_seed & (region_means(regions, grey) < max_grey_level)
    dark[0] = False
    return dark
