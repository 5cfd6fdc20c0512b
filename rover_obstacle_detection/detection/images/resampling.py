"""Resampling of arrays with a value for each pixel."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


def resized(array: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    """Give each pixel of the new shape the value of the nearest one.

    Parameters
    ----------
    array : ndarray, shape (height, width)
        Of a type that OpenCV knows, or bool.
    shape : tuple of int
        New height and width.
    """
    values = array.view(np.uint8) if array.dtype == np.bool_ else array
    resampled = cv2.resize(values, shape[::-1], interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(resampled).view(array.dtype)
