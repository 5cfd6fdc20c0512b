"""The windows of the image that the network looks at."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Window = tuple[slice, slice]
"""Rows and columns of a part of the image."""

BLOCK_PX = 16
"""Sides of windows are multiples of it: a network may go down to a sixteenth of the resolution."""

MARGIN_BLOCKS = 2
"""Blocks around a pixel that matter to the network's output there."""


def windows_around(where: NDArray[np.bool_]) -> list[Window]:
    """Cover all marked pixels, and what the network sees around them, by windows.

    Parameters
    ----------
    where : ndarray of bool, shape (height, width)

    Returns
    -------
    list of tuple of two slices
        One window for each group of pixels, or a single one where that has fewer pixels.
    """
    height, width = where.shape
    whole = cv2.copyMakeBorder(
        where.view(np.uint8), 0, -height % BLOCK_PX, 0, -width % BLOCK_PX, cv2.BORDER_CONSTANT
    )
    size = whole.shape[1] // BLOCK_PX, whole.shape[0] // BLOCK_PX
    means = cv2.resize(whole.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    blocks = (means > 0).astype(np.uint8)
    kernel = np.ones((2 * MARGIN_BLOCKS + 1,) * 2, np.uint8)
    boxes = _boxes(np.asarray(cv2.dilate(blocks, kernel), np.uint8))
    if len(boxes) > 1:
        (top, left), (bottom, right) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1).sum()
        if area >= (bottom - top) * (right - left):
            boxes = np.array([[top, left, bottom, right]])
    boxes = np.minimum(boxes * BLOCK_PX, [height, width] * 2)
    return [
        (slice(int(top), int(bottom)), slice(int(left), int(right)))
        for top, left, bottom, right in boxes
    ]


def _boxes(where: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Top, left, bottom and right of the connected parts."""
    _, _, boxes, _ = cv2.connectedComponentsWithStats(where, connectivity=8)
    left, top, width, height = boxes[1:, :4].T
    return np.stack((top, left, top + height, left + width), axis=1)
