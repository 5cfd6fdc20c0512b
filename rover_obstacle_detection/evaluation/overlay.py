"""Overlay of hits, misses and false positives on the left image."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.evaluation.labels import is_counted, is_obstacle

HIT_BGR = (90, 200, 60)
MISS_BGR = (255, 110, 30)
FALSE_BGR = (40, 40, 235)
NOT_COUNTED_BGR = (150, 150, 150)
OPACITY = 0.45


def judgement_picture(
    left: NDArray[Any], mask: NDArray[np.uint8], labels: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Draw hits green, misses blue, false positives red and uncounted pixels grey.

    Parameters
    ----------
    left : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
    mask, labels : ndarray of uint8, shape (height, width)

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        BGR.
    """
    picture = left if left.dtype == np.uint8 else (left >> 8).astype(np.uint8)
    if picture.ndim == 2:
        picture = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    flagged, obstacle, counted = mask != 0, is_obstacle(labels), is_counted(labels)
    tinted = picture.astype(np.float32)
    for where, colour in (
        (flagged & obstacle, HIT_BGR),
        (~flagged & obstacle, MISS_BGR),
        (flagged & counted & ~obstacle, FALSE_BGR),
        (~counted, NOT_COUNTED_BGR),
    ):
        tinted[where] = (1 - OPACITY) * tinted[where] + OPACITY * np.asarray(colour, np.float32)
    result: NDArray[np.uint8] = tinted.astype(np.uint8)
    return result
