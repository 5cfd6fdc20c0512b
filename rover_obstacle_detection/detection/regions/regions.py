"""Statistics of each region, and which regions are seeds (study, section 4.2 step 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
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


@dataclass(frozen=True, eq=False)
class Nearest:
    """The nearest known pixel of each unknown one.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image.
    pixels : ndarray of int, shape (n,)
        Flat indices of the unknown pixels with a known one in reach.
    sources : ndarray of int, shape (n,)
        Flat indices of their nearest known pixels.
    """

    shape: tuple[int, ...]
    pixels: NDArray[np.intp]
    sources: NDArray[np.intp]


def nearest_known(known: NDArray[np.bool_], reach_px: NDArray[np.float32]) -> Nearest:
    """Find the nearest known pixel of each unknown one.

    Parameters
    ----------
    known : ndarray of bool, shape (height, width)
    reach_px : ndarray of float32, shape (height, width)
        Distance from each known pixel up to which unknown ones may use it.

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
    # OpenCV labels the known pixels from 1, row by row.
    sources = np.flatnonzero(known)[labels.ravel()[unknown] - 1]
    in_reach = distance.ravel()[unknown] <= reach_px.ravel()[sources]
    return Nearest(known.shape, unknown[in_reach], sources[in_reach])


def carried(
    values: NDArray[np.bool_], nearest: Nearest, regions: NDArray[np.int32] | None = None
) -> NDArray[np.bool_]:
    """Copy values from known pixels to the unknown ones nearest to them.

    Parameters
    ----------
    values : ndarray of bool, shape (height, width)
    nearest : Nearest
    regions : ndarray of int32, shape (height, width), optional
        Values are only copied within a region.

    Returns
    -------
    ndarray of bool, shape (height, width)
        False at known pixels.
    """
    found = np.zeros(nearest.shape, np.bool_)
    taken = values.ravel()[nearest.sources]
    if regions is not None:
        taken = taken & (regions.ravel()[nearest.sources] == regions.ravel()[nearest.pixels])
    found.ravel()[nearest.pixels] = taken
    return found
