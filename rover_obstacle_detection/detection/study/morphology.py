"""The last smoothing of the obstacle map (study, section 4.2 step 7)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def close_then_open(mask: NDArray[np.uint8], size: int, iterations: int) -> NDArray[np.uint8]:
    """Fill small holes, then drop small specks, with an elliptical kernel.

    Parameters
    ----------
    mask : ndarray of uint8, shape (height, width)
    size : int
        Diameter of the kernel, pixels.
    iterations : int
        Dilations and erosions of each operation.
    """
    if iterations == 0:
        return mask
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel, iterations=iterations)
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, kernel, iterations=iterations)
    return np.asarray(opened, np.uint8)
