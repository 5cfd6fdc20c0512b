"""What the pixels of a labelled frame mean."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

FREE = 0
ROCK = 1
SLOPE = 2
DROP = 3
NOT_COUNTED = 255


def is_counted(labels: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Tell the pixels that figures are made of."""
    counted: NDArray[np.bool_] = labels != NOT_COUNTED
    return counted


def is_obstacle(labels: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Tell the pixels of rocks, slopes and drops."""
    obstacle: NDArray[np.bool_] = (labels != FREE) & (labels != NOT_COUNTED)
    return obstacle


def connected(area: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Give the 8-connected parts of an area numbers from 1 up; 0 is outside."""
    _, numbers = cv2.connectedComponents(area.astype(np.uint8), connectivity=8)
    return np.asarray(numbers, np.int32)
