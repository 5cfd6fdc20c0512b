"""Where the image has edges at the scale of outlines."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

REDUCTION = 2
SMOOTHING_PX = 1.0


def edge_strength(grey: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Measure how fast the grey level changes, at half the image's size.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)

    Returns
    -------
    ndarray of float32, shape ((height + 1) // 2, (width + 1) // 2)
        Grey levels per pixel of the smaller image, which is smoothed: an outline drawn a pixel
        beside an edge still lies on it.
    """
    # An even size, so that each pixel of the smaller image is two by two of the larger.
    padding = ((0, grey.shape[0] % REDUCTION), (0, grey.shape[1] % REDUCTION))
    even = np.pad(grey, padding, mode='edge') if padding != ((0, 0), (0, 0)) else grey
    size = even.shape[1] // REDUCTION, even.shape[0] // REDUCTION
    small = cv2.resize(even, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    smooth = cv2.GaussianBlur(small, (0, 0), SMOOTHING_PX)
    across, down = (
        cv2.Sobel(smooth, cv2.CV_32F, *order, scale=1 / 8) for order in ((1, 0), (0, 1))
    )
    return np.asarray(cv2.magnitude(across, down), np.float32)
