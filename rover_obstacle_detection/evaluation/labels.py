"""Label values of a labelled frame."""

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
    """Mark the pixels that count in the figures."""
    return np.asarray(labels != NOT_COUNTED)


def is_obstacle(labels: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Mark the pixels of rocks, slopes and drops."""
    return np.asarray((labels != FREE) & (labels != NOT_COUNTED))


def connected(area: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Give the 8-connected components of an area numbers from 1; 0 is outside."""
    _, numbers = cv2.connectedComponents(area.astype(np.uint8), connectivity=8)
    return np.asarray(numbers, np.int32)
