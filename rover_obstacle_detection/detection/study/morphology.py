"""Final smoothing of the obstacle mask (study, section 4.2 step 7)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def close_then_open(mask: NDArray[np.uint8], size_px: int, iterations: int) -> NDArray[np.uint8]:
    """Fill small holes, then remove small specks, with an elliptical kernel.

    Parameters
    ----------
    mask : ndarray of uint8, shape (height, width)
    size_px : int
        Diameter of the kernel.
    iterations : int
        Dilations and erosions of each operation; 0 leaves the mask as it is.
    """
    if iterations == 0:
        return mask
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size_px, size_px))
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel, iterations=iterations)
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, kernel, iterations=iterations)
    return np.asarray(opened, np.uint8)
