"""What a filter responds at each brightness of an image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.robust import robust_spread
from rover_obstacle_detection.detection.images.parameters import ImageParameters

Image = NDArray[np.float32]
Levels = NDArray[np.float32]
"""A value at each grey level, shape (256,)."""


@dataclass(frozen=True, eq=False)
class Spread:
    """A measure of an image, such as the spread of a filter's response.

    Parameters
    ----------
    overall : float
        In the whole image.
    by_brightness : ndarray of float32, shape (256,)
        Where the image has each grey level on average.
    """

    overall: float
    by_brightness: Levels

    def scaled(self, factor: float, least: float) -> Spread:
        """Return the spread times a factor, and no smaller than the least."""
        scaled = np.maximum(self.by_brightness * np.float32(factor), np.float32(least))
        return Spread(max(self.overall * factor, least), scaled)


def spread_by_brightness(
    response: cv2.typing.MatLike, grey: NDArray[np.uint8], parameters: ImageParameters
) -> Spread:
    """Estimate the spread of a response in a sample of the pixels.

    Black and saturated pixels do not count, unless almost all are.

    Parameters
    ----------
    response : ndarray, shape (height, width)
    grey : ndarray of uint8, shape (height, width)
        The image that the filter was applied to.
    parameters : ImageParameters
    """
    p = parameters
    thin = max(1, math.isqrt(grey.size // p.noise_samples))
    every = np.s_[::thin, ::thin]
    mean, sample = _local_mean(grey, p)[every].ravel(), np.asarray(response)[every].ravel()
    exposed = (mean > p.black_grey_level) & (mean < p.white_grey_level)
    if np.count_nonzero(exposed) > p.min_exposed_share * exposed.size:
        mean, sample = mean[exposed], sample[exposed]
    # Bytes are sorted in linear time.
    order = np.argsort(mean, kind='stable')
    ends = np.searchsorted(mean[order], p.brightness_bands)
    levels, spreads = [], []
    for band in np.split(order, ends):
        if band.size > p.min_band_share * mean.size:
            levels.append(float(mean[band].mean()))
            spreads.append(robust_spread(sample[band]))
    by_brightness = np.interp(np.arange(256), levels, spreads).astype(np.float32)
    return Spread(robust_spread(sample), by_brightness)


def looked_up(levels: Levels, grey: NDArray[np.uint8], parameters: ImageParameters) -> Image:
    """Return the value at the local brightness of each pixel.

    Parameters
    ----------
    levels : ndarray of float32, shape (256,)
    grey : ndarray of uint8, shape (height, width)
    parameters : ImageParameters

    Returns
    -------
    ndarray of float32, shape (height, width)
    """
    return np.asarray(cv2.LUT(_local_mean(grey, parameters), levels), np.float32)


def grey_level_shares(grey: NDArray[np.uint8], parameters: ImageParameters) -> Levels:
    """Share of the pixels that have each grey level.

    Black and saturated pixels do not count, unless almost all are.
    """
    counts = cv2.calcHist([grey], [0], None, [256], [0, 256]).ravel()
    exposed = counts.copy()
    exposed[: parameters.black_grey_level + 1] = exposed[parameters.white_grey_level :] = 0
    if exposed.sum() > parameters.min_exposed_share * counts.sum():
        counts = exposed
    return np.asarray(counts / counts.sum(), np.float32)


def _local_mean(grey: NDArray[np.uint8], parameters: ImageParameters) -> NDArray[np.uint8]:
    return np.asarray(cv2.blur(grey, (parameters.exposure_window_px,) * 2), np.uint8)
