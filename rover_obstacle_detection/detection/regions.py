"""Figures of each region, and which regions are seeds (study, section 4.2 step 5)."""

from __future__ import annotations

from typing import Any

import cv2
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


def nearest_values(
    known: NDArray[np.bool_],
    values: NDArray[np.bool_],
    regions: NDArray[np.int32],
    reach_px: NDArray[np.float32],
) -> NDArray[np.bool_]:
    """Carry values from where they are known to the pixels around, not across regions.

    Parameters
    ----------
    known, values : ndarray of bool, shape (height, width)
    regions : ndarray of int32, shape (height, width)
    reach_px : ndarray of float32, shape (height, width)
        How far each known pixel's value is carried.

    Returns
    -------
    ndarray of bool, shape (height, width)
        The value of the nearest known pixel; False where that lies in another region or too far.
    """
    found = known & values
    unknown = np.flatnonzero(~known)
    if not found.any() or not unknown.size:
        return found
    distance, labels = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    # Labels number the known pixels from 1, row by row.
    source = np.flatnonzero(known)[labels.ravel()[unknown] - 1]
    found.ravel()[unknown] = (
        values.ravel()[source]
        & (distance.ravel()[unknown] <= reach_px.ravel()[source])
        & (regions.ravel()[source] == regions.ravel()[unknown])
    )
    return found
