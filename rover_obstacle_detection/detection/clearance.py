"""Height above the local ground against the rover's clearance."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def grown_from_cores(
    height_m: NDArray[np.float32],
    core_m: NDArray[np.float32] | float,
    foot_m: NDArray[np.float32] | float,
    min_core_pixels: int,
) -> NDArray[np.bool_]:
    """Keep what rises over the foot level and is connected with enough that rises over the core.

    Parameters
    ----------
    height_m : ndarray of float32, shape (height, width)
        Above the local ground, metres; NaN where none.
    core_m, foot_m : float or ndarray of float32, shape (height, width)
        Height that makes an obstacle, and height down to which it is grown, metres.
    min_core_pixels : int
        Cores of fewer pixels are noise.

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    Hysteresis thresholding (Canny 1986) in place of the study's single threshold.
    """
    with np.errstate(invalid='ignore'):
        foot = (height_m > foot_m).astype(np.uint8)
        core = height_m > core_m
    count, labels = cv2.connectedComponents(foot, connectivity=8)
    cores = np.bincount(labels[core], minlength=count)
    keep = cores >= min_core_pixels
    keep[0] = False
    return np.asarray(keep[labels])


def small_parts(mask: NDArray[np.bool_], min_pixels: int) -> NDArray[np.bool_]:
    """Find the 8-connected parts of a mask that have fewer than ``min_pixels`` pixels."""
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    small = boxes[:, cv2.CC_STAT_AREA] < min_pixels
    small[0] = False
    return np.asarray(small[labels])
