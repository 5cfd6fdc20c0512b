"""Bringing the obstacle map to the outlines that the image shows."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray


def texture_level(grey: NDArray[np.uint8]) -> float:
    """Spread of the grey level within a few pixels: texture and noise, not outlines.

    The median of the absolute deviation from a 9 x 9 mean, as a standard deviation; at least 1.
    """
    image = grey.astype(np.float32)
    deviation = cv2.absdiff(image, cv2.blur(image, (9, 9)))
    # A median of some ten thousand pixels is as good as one of all.
    thin = max(1, math.isqrt(grey.size // 10_000))
    return max(1.0, 1.4826 * float(np.median(deviation[::thin, ::thin])))


def untextured(grey: NDArray[np.uint8], size: int, min_difference: float) -> NDArray[np.bool_]:
    """Find where there is nothing that could be matched along a row: sky, lightless shadow.

    Semi-global matching carries the disparity of what is around into such places.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    size : int
        Side of the window, pixels, odd.
    min_difference : float
        Mean difference between a pixel's neighbours on either side, grey levels; sensor noise of
        a standard deviation s has 1.1 s.
    """
    difference = np.zeros_like(grey)
    difference[:, 1:-1] = cv2.absdiff(grey[:, 2:], grey[:, :-2])
    # Sums stay whole numbers, where a mean of bytes would be rounded.
    total = cv2.boxFilter(difference, cv2.CV_16U, (size, size), normalize=False)
    return np.asarray(total < min_difference * size * size)
