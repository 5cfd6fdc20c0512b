"""Connected components of a mask: their height, their size and their holes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def top_heights(
    height_m: NDArray[np.float32], parts: NDArray[np.int32], share: float
) -> NDArray[np.float32]:
    """Average the highest pixels of each component.

    Parameters
    ----------
    height_m : ndarray of float32, shape (height, width)
        Metres.
    parts : ndarray of int32, shape (height, width)
        Component of each pixel; 0 is none.
    share : float
        Share of a component's pixels that are averaged, at least one pixel.

    Returns
    -------
    ndarray of float32, shape (components + 1,)
        Metres; 0 for components without a pixel.
    """
    flat = parts.ravel()
    inside = np.flatnonzero(flat)
    number, height = flat[inside], height_m.ravel()[inside].astype(np.float64)
    tops = np.zeros(int(parts.max(initial=0)) + 1, np.float32)
    if not inside.size:
        return tops
    count = np.bincount(number, minlength=tops.size)
    first = np.concatenate(([0], np.cumsum(count)))[:-1]
    # One key per pixel sorts by component, then by descending height.
    span = 1 + height.max() - height.min()
    highest = number * span + (height.max() - height)
    highest.sort()
    highest = height.max() - (highest - np.repeat(np.arange(tops.size), count) * span)
    running = np.concatenate(([0.0], np.cumsum(highest)))
    found = np.flatnonzero(count)
    averaged = np.maximum((count[found] * share).astype(np.intp), 1)
    tops[found] = (running[first[found] + averaged] - running[first[found]]) / averaged
    return tops


def small_parts(mask: NDArray[np.bool_], min_pixels: int) -> NDArray[np.bool_]:
    """Find the 8-connected components with fewer than ``min_pixels`` pixels.

    Parameters
    ----------
    mask : ndarray of bool, shape (height, width)
    min_pixels : int

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    if not mask.any():
        return np.zeros_like(mask)
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    small = np.bincount(labels[mask], minlength=count) < min_pixels
    small[0] = False
    return np.asarray(small[labels])


def high_holes(
    mask: NDArray[np.bool_], height_m: NDArray[np.float32], min_height_m: float
) -> NDArray[np.bool_]:
    """Find the holes of a mask that are part of the obstacle, as they are high themselves.

    Parameters
    ----------
    mask : ndarray of bool, shape (height, width)
    height_m : ndarray of float32, shape (height, width)
        Metres; no NaN.
    min_height_m : float
        Mean height above which a hole is filled.

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    A hole is a 4-connected component of the background that does not touch the image border.
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
    sums = np.bincount(labels.ravel(), weights=height_m.ravel(), minlength=len(boxes))
    high = inner & (sums > min_height_m * boxes[:, cv2.CC_STAT_AREA])
    return np.asarray(high[labels])
