"""How noisy an image is against its texture, and smoothing by as much as that asks for."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.grey_pair import GreyPair

# Below the first ratio of noise to texture matching needs no help; from the second on all of it.
_QUIET_RATIO = 0.8
_NOISY_RATIO = 1.2
_SMOOTHING_PX = 1.0
_SAMPLES = 100_000
_WINDOW = 9
_BLACK, _WHITE = 2, 253
_MIN_SHARE = 0.1


def image_noise(grey: NDArray[np.uint8]) -> float:
    """Estimate the standard deviation of the sensor's noise, grey levels; at least 0.5.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)

    Notes
    -----
    Immerkær 1996: the difference of two Laplacians is blind to edges and slopes of grey. The
    median in place of the mean keeps rich texture from counting as noise. Rounding to whole levels
    alone has 0.3.
    """
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    response = cv2.filter2D(grey, cv2.CV_16S, kernel)
    return max(0.5, _spread(response, exposed(grey)) / 6)


def gradient_level(grey: NDArray[np.uint8]) -> float:
    """Typical change of grey from pixel to pixel along a row: what matching lives on."""
    return max(0.1, _spread(cv2.Scharr(grey, cv2.CV_16S, 1, 0), exposed(grey)) / 32)


def exposed(grey: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Tell where the sensor had something to measure: not in a black sky, nor where it clips.

    Returns
    -------
    ndarray of bool, shape (height, width)
        True everywhere where that would leave too little.
    """
    size = (_WINDOW, _WINDOW)
    mean = cv2.blur(grey, size)
    inside = (mean > _BLACK) & (mean < _WHITE)
    return np.asarray(inside if inside.mean() > _MIN_SHARE else np.ones_like(inside))


def noise_share(grey: NDArray[np.uint8]) -> float:
    """Tell how far noise drowns texture: 0 where it does not, 1 where it does altogether."""
    ratio = image_noise(grey) / gradient_level(grey)
    return min(max((ratio - _QUIET_RATIO) / (_NOISY_RATIO - _QUIET_RATIO), 0.0), 1.0)


def smoothed_against_noise(pair: GreyPair, share: float) -> GreyPair:
    """Smooth both eyes alike, by up to a standard deviation of one pixel."""
    if share == 0:
        return pair
    left, right = (
        np.asarray(cv2.GaussianBlur(eye, (0, 0), share * _SMOOTHING_PX), np.uint8) for eye in pair
    )
    return left, right


def _spread(values: cv2.typing.MatLike, where: NDArray[np.bool_]) -> float:
    """Estimate the standard deviation by the median of the absolute values."""
    thin = max(1, math.isqrt(where.size // _SAMPLES))
    sample = np.asarray(values)[::thin, ::thin][where[::thin, ::thin]]
    return 1.4826 * float(np.median(np.abs(sample))) if sample.size else 0.0
