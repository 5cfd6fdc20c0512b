"""Figures of each region, and which regions are seeds (study, section 4.2 step 5)."""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True, eq=False)
class Nearest:
    """For pixels of which something is not known, the nearest pixel of which it is.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image.
    pixels : ndarray of int, shape (n,)
        Those with a known pixel in reach, as flat indices.
    sources : ndarray of int, shape (n,)
        The nearest known pixel of each.
    """

    shape: tuple[int, ...]
    pixels: NDArray[np.intp]
    sources: NDArray[np.intp]


def nearest_known(known: NDArray[np.bool_], reach_px: NDArray[np.float32]) -> Nearest:
    """Find the nearest known pixel of every other that is in its reach.

    Parameters
    ----------
    known : ndarray of bool, shape (height, width)
    reach_px : ndarray of float32, shape (height, width)
        How far each known pixel reaches.

    Returns
    -------
    Nearest
    """
    unknown = np.flatnonzero(~known)
    if not unknown.size or unknown.size == known.size:
        nothing = np.zeros(0, np.intp)
        return Nearest(known.shape, nothing, nothing)
    distance, labels = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    # Labels number the known pixels from 1, row by row.
    sources = np.flatnonzero(known)[labels.ravel()[unknown] - 1]
    in_reach = distance.ravel()[unknown] <= reach_px.ravel()[sources]
    return Nearest(known.shape, unknown[in_reach], sources[in_reach])


def carried(
    values: NDArray[np.bool_], nearest: Nearest, regions: NDArray[np.int32] | None = None
) -> NDArray[np.bool_]:
    """Carry values from where they are known to the pixels around.

    Parameters
    ----------
    values : ndarray of bool, shape (height, width)
    nearest : Nearest
    regions : ndarray of int32, shape (height, width), optional
        Regions that values are not carried out of.

    Returns
    -------
    ndarray of bool, shape (height, width)
        The value of the nearest known pixel, at pixels that are not known; False elsewhere.
    """
    found = np.zeros(nearest.shape, np.bool_)
    taken = values.ravel()[nearest.sources]
    if regions is not None:
        taken = taken & (regions.ravel()[nearest.sources] == regions.ravel()[nearest.pixels])
    found.ravel()[nearest.pixels] = taken
    return found
