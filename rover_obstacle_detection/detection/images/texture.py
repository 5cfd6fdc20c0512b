"""Texture within a few pixels, and where there is none."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.robust import robust_spread
from rover_obstacle_detection.detection.images.parameters import ImageParameters


def texture_level(grey: NDArray[np.uint8], parameters: ImageParameters) -> float:
    """Estimate the standard deviation of the grey level within a few pixels.

    It covers texture and noise. Outlines of objects hardly count.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    parameters : ImageParameters
    """
    thin = max(1, math.isqrt(grey.size // parameters.texture_samples))
    every = np.s_[::thin, ::thin]
    mean = cv2.boxFilter(grey, cv2.CV_32F, (parameters.texture_window_px,) * 2)
    return max(parameters.min_texture, robust_spread(grey[every] - np.asarray(mean)[every]))


def untextured(grey: NDArray[np.uint8], size_px: int, min_difference: float) -> NDArray[np.bool_]:
    """Find where nothing can be matched along a row: sky and black shadow.

    Semi-global matching fills such places with the disparity around them.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    size_px : int
        Side of the window, odd.
    min_difference : float
        Mean difference between the left and right neighbour of a pixel, grey levels. Noise of
        standard deviation s has 1.1 s.

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    difference = np.zeros_like(grey)
    difference[:, 1:-1] = cv2.absdiff(grey[:, 2:], grey[:, :-2])
    # Sums stay whole numbers. A mean of bytes would be rounded.
    total = cv2.boxFilter(difference, cv2.CV_16U, (size_px, size_px), normalize=False)
    return np.asarray(total < min_difference * size_px * size_px)
