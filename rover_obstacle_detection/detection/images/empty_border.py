"""The black border that rectification leaves where the camera saw nothing."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def empty_border(
    grey: NDArray[np.uint8], block_px: int, reach_px: int
) -> NDArray[np.bool_] | None:
    """Find the empty border of a rectified image.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    block_px : int
        Odd. The border is made of blocks of this side that are 0 in every pixel and reach one
        another from beyond the image's edge. Black outlines of objects are thinner.
    reach_px : int
        Pixels within this distance of the border count as well.

    Returns
    -------
    ndarray of bool, shape (height, width), or None
        None if there is no border, as in most images. Black sky and shadow at the image's edge
        are found as well.
    """
    # A block reaches beyond the image's edge by half.
    if max(_longest_black(each) for each in (grey[0], grey[-1], grey[:, 0], grey[:, -1])) < (
        block_px // 2
    ):
        return None
    outside = block_px // 2 + 1
    padded = cv2.copyMakeBorder(grey, *(outside,) * 4, cv2.BORDER_CONSTANT, value=0)
    brightest = cv2.dilate(padded, np.ones((block_px,) * 2, np.uint8))
    reached = np.zeros(np.add(brightest.shape, 2), np.uint8)
    cv2.floodFill(brightest, reached, (0, 0), 0, 0, 0, 4 | cv2.FLOODFILL_MASK_ONLY | 1 << 8)
    inside = slice(outside, -outside)
    blocks = cv2.dilate(reached[1:-1, 1:-1], np.ones((block_px,) * 2, np.uint8))[inside, inside]
    if not blocks.any():
        return None
    return np.asarray(cv2.dilate(blocks, np.ones((2 * reach_px + 1,) * 2, np.uint8)) > 0)


def _longest_black(line: NDArray[np.uint8]) -> int:
    """Length of the longest run of zeros."""
    bright = np.flatnonzero(np.concatenate(([1], line, [1])))
    return int(np.diff(bright).max()) - 1
