"""Height above the local ground against the rover's clearance."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def grown_from_cores(
    height_m: NDArray[np.float32],
    core_m: NDArray[np.float32] | float,
    foot_m: NDArray[np.float32] | float,
    min_core_pixels: int,
) -> NDArray[np.bool_]:
    """Keep what rises over the foot level and is connected with enough that rises over the core.

    Parameters
    ----------
    height_m : ndarray of float32, shape (height, width)
        Above the local ground, metres; NaN where none.
    core_m, foot_m : float or ndarray of float32, shape (height, width)
        Height that makes an obstacle, and height down to which it is grown, metres.
    min_core_pixels : int
        Cores of fewer pixels are noise.

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    Hysteresis thresholding (Canny 1986) in place of the study's single threshold.
    """
    with np.errstate(invalid='ignore'):
        foot = (height_m > foot_m).astype(np.uint8)
        core = height_m > core_m
    count, labels = cv2.connectedComponents(foot, connectivity=8)
    cores = np.bincount(labels[core], minlength=count)
    keep = cores >= min_core_pixels
    keep[0] = False
    return np.asarray(keep[labels])


def top_heights(
    height_m: NDArray[np.float32], parts: NDArray[np.int32], share: float
) -> NDArray[np.float32]:
    """Find how high each part stands: the mean of its highest pixels.

    Parameters
    ----------
    height_m : ndarray of float32, shape (height, width)
        Metres.
    parts : ndarray of int32, shape (height, width)
        Number of each pixel's part; 0 is none.
    share : float
        Share of a part's pixels that are averaged, at least one.

    Returns
    -------
    ndarray of float32, shape (parts + 1,)
        Metres; 0 for numbers without a pixel.
    """
    flat = parts.ravel()
    inside = np.flatnonzero(flat)
    number, height = flat[inside], height_m.ravel()[inside]
    order = np.lexsort((-height, number))
    number, height = number[order], height[order].astype(np.float64)
    tops = np.zeros(int(parts.max(initial=0)) + 1, np.float32)
    found, first, count = np.unique(number, return_index=True, return_counts=True)
    averaged = np.maximum((count * share).astype(np.intp), 1)
    running = np.concatenate(([0.0], np.cumsum(height)))
    tops[found] = (running[first + averaged] - running[first]) / averaged
    return tops


def small_parts(mask: NDArray[np.bool_], min_pixels: int) -> NDArray[np.bool_]:
    """Find the 8-connected parts of a mask that have fewer than ``min_pixels`` pixels."""
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    small = boxes[:, cv2.CC_STAT_AREA] < min_pixels
    small[0] = False
    return np.asarray(small[labels])


def high_holes(
    mask: NDArray[np.bool_], height_m: NDArray[np.float32], min_height_m: float
) -> NDArray[np.bool_]:
    """Find the holes of a mask that stand high themselves: no ground, but more of the obstacle.

    Parameters
    ----------
    mask : ndarray of bool, shape (height, width)
    height_m : ndarray of float32, shape (height, width)
        Metres; no NaN.
    min_height_m : float
        Mean height over which a hole is none.

    Notes
    -----
    A hole is a 4-connected part of the rest that does not touch the border of the image.
    """
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(
        (~mask).astype(np.uint8), connectivity=4
    )
    height, width = mask.shape
    left, top = boxes[:, cv2.CC_STAT_LEFT], boxes[:, cv2.CC_STAT_TOP]
    inner = (left > 0) & (top > 0)
    inner &= left + boxes[:, cv2.CC_STAT_WIDTH] < width
    inner &= top + boxes[:, cv2.CC_STAT_HEIGHT] < height
    inner[0] = False
    if not inner.any():
        return np.zeros_like(mask)
    flat = labels.ravel()
    sums = np.bincount(flat, weights=height_m.ravel(), minlength=len(boxes))
    high = inner & (sums > min_height_m * boxes[:, cv2.CC_STAT_AREA])
    return np.asarray(high[labels])
