"""Connected parts of a mask: how high they stand, how large they are, what they enclose."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


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
    number, height = flat[inside], height_m.ravel()[inside].astype(np.float64)
    tops = np.zeros(int(parts.max(initial=0)) + 1, np.float32)
    if not inside.size:
        return tops
    count = np.bincount(number, minlength=tops.size)
    first = np.concatenate(([0], np.cumsum(count)))[:-1]
    # One sort of one key for each pixel: by part, the highest first.
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
