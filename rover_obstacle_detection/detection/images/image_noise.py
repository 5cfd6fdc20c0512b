"""Noise of an image against its texture, at each brightness, and the smoothing it calls for.

Shadow and light differ: the same texture has less contrast in shadow, and the noise of a sensor,
or what a tone curve makes of it, depends on the brightness.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.brightness import (
    Levels,
    Spread,
    grey_level_shares,
    looked_up,
    spread_by_brightness,
)
from rover_obstacle_detection.detection.images.parameters import ImageParameters

_IDENTITY = np.ones((1, 1))
_ROUNDING = 12**-0.5
"""Standard deviation of rounding to whole grey levels."""


def image_noise(grey: NDArray[np.uint8], parameters: ImageParameters) -> Spread:
    """Estimate the standard deviation of the sensor's noise, grey levels.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    parameters : ImageParameters

    Notes
    -----
    Immerkær 1996: the difference of two Laplacians ignores edges and grey-level ramps. The median
    replaces his mean, so that rich texture does not count as noise.
    """
    second_difference = np.array([1, -2, 1], np.float32)
    response = cv2.sepFilter2D(grey, cv2.CV_16S, second_difference, second_difference)
    return spread_by_brightness(response, grey, parameters).scaled(1 / 6, parameters.min_noise)


def image_gradient(grey: NDArray[np.uint8], parameters: ImageParameters) -> Spread:
    """Estimate the typical gradient along the rows, grey levels per pixel.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    parameters : ImageParameters
    """
    gradient = cv2.Scharr(grey, cv2.CV_16S, 1, 0)
    return spread_by_brightness(gradient, grey, parameters).scaled(1 / 32, parameters.min_gradient)


def noise_share(noise: Spread, gradient: Spread, parameters: ImageParameters) -> Spread:
    """Measure how far noise hides the texture: 0 not at all, 1 completely.

    Parameters
    ----------
    noise, gradient : Spread
        Of one image.
    parameters : ImageParameters
    """
    quiet, noisy = parameters.quiet_noise_ratio, parameters.noisy_noise_ratio
    ratio = noise.overall / gradient.overall
    by_brightness = noise.by_brightness / gradient.by_brightness
    return Spread(
        min(max((ratio - quiet) / (noisy - quiet), 0.0), 1.0),
        np.clip((by_brightness - np.float32(quiet)) / np.float32(noisy - quiet), 0, 1),
    )


class Smoothed(NamedTuple):
    """An image smoothed against its noise.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    noise : Spread
        What is left of the noise. It cannot be estimated from the smoothed image, where
        neighbours share theirs.
    noise_gradient : ndarray of float32, shape (256,)
        What `image_gradient` finds at each brightness where there is nothing but this noise.
    share : float
        How far noise hid the texture of the whole image, 0 to 1.
    """

    grey: NDArray[np.uint8]
    noise: Spread
    noise_gradient: Levels
    share: float


def smoothed_against_noise(
    grey: NDArray[np.uint8], noise: Spread, share: Spread, parameters: ImageParameters
) -> Smoothed:
    """Smooth each pixel as far as noise hides the texture at its brightness.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    noise : Spread
    share : Spread
        Result of `noise_share`. At a brightness where it is 0, the image stays as it is.
    parameters : ImageParameters
    """
    shares = share.by_brightness
    scharr = np.outer((3, 10, 3), (-1, 0, 1)) / 32
    gradient = noise.by_brightness * remaining_noise(shares, parameters, scharr)
    if not shares.any():
        return Smoothed(grey, noise, gradient, share.overall)
    weight = looked_up(shares, grey, parameters)
    smooth = cv2.GaussianBlur(grey, (0, 0), parameters.smoothing_px)
    blended = np.asarray(cv2.blendLinear(smooth, grey, weight, 1 - weight), np.uint8)
    rounding = np.float32(_ROUNDING) * (shares > 0)
    left = np.hypot(noise.by_brightness * remaining_noise(shares, parameters), rounding)
    gradient = np.hypot(gradient, rounding * np.float32(np.linalg.norm(scharr)))
    brightness = grey_level_shares(grey, parameters)
    kept = float(brightness @ left) / float(brightness @ noise.by_brightness)
    return Smoothed(blended, Spread(noise.overall * kept, left), gradient, share.overall)


def remaining_noise(
    share: Levels, parameters: ImageParameters, kernel: NDArray[np.float64] = _IDENTITY
) -> Levels:
    """Compute how much of the noise's standard deviation smoothing leaves.

    Parameters
    ----------
    share : ndarray of float32, shape (256,)
        Result of `noise_share` at each brightness.
    parameters : ImageParameters
    kernel : ndarray of float64, at most 3 x 3
        Filter applied afterwards; none if omitted.

    Returns
    -------
    ndarray of float32, shape (256,)
    """
    reach = math.ceil(4 * parameters.smoothing_px)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / parameters.smoothing_px) ** 2)
    centre = np.zeros_like(weights)
    centre[reach] = weights.sum()
    kept, smooth = (
        cv2.filter2D(
            np.pad(np.outer(each, each) / weights.sum() ** 2, 1),
            -1, kernel, borderType=cv2.BORDER_CONSTANT,
        )
        for each in (centre, weights)
    )  # fmt: skip
    # Of two filtered images added, each with its share: variances, and twice the covariance.
    variance = (1 - share) ** 2 * float(np.sum(kept**2))
    variance += 2 * share * (1 - share) * float(np.sum(kept * smooth))
    variance += share**2 * float(np.sum(smooth**2))
    return np.asarray(np.sqrt(variance), np.float32)
