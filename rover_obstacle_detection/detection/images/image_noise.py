"""Noise of an image relative to its texture, and the smoothing that noise calls for."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.robust import robust_spread
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.parameters import ImageParameters


def image_noise(grey: NDArray[np.uint8], parameters: ImageParameters) -> float:
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
    return max(parameters.min_noise, _exposed_spread(response, grey, parameters) / 6)


def gradient_level(grey: NDArray[np.uint8], parameters: ImageParameters) -> float:
    """Estimate the typical gradient along the rows, grey levels per pixel.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    parameters : ImageParameters
    """
    gradient = cv2.Scharr(grey, cv2.CV_16S, 1, 0)
    return max(parameters.min_gradient, _exposed_spread(gradient, grey, parameters) / 32)


def noise_share(grey: NDArray[np.uint8], parameters: ImageParameters) -> float:
    """Measure how far noise hides the texture: 0 not at all, 1 completely.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    parameters : ImageParameters
    """
    quiet, noisy = parameters.quiet_noise_ratio, parameters.noisy_noise_ratio
    ratio = image_noise(grey, parameters) / gradient_level(grey, parameters)
    return min(max((ratio - quiet) / (noisy - quiet), 0.0), 1.0)


def smoothed_against_noise(pair: GreyPair, share: float, parameters: ImageParameters) -> GreyPair:
    """Smooth both images equally, in proportion to the noise.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    share : float
        Result of `noise_share`. At 0 the pair itself is returned.
    parameters : ImageParameters
    """
    if share == 0:
        return pair
    sigma_px = share * parameters.max_smoothing_px
    left, right = (
        np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), np.uint8) for image in pair
    )
    return left, right


def remaining_noise(share: float, parameters: ImageParameters) -> float:
    """Compute how much of the noise's standard deviation `smoothed_against_noise` leaves.

    It cannot be estimated from the smoothed image, where neighbours share their noise.

    Parameters
    ----------
    share : float
        Result of `noise_share`.
    parameters : ImageParameters

    Returns
    -------
    float
        0 to 1.
    """
    if share == 0:
        return 1.0
    sigma_px = share * parameters.max_smoothing_px
    reach = math.ceil(4 * sigma_px)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma_px) ** 2)
    return float(np.sum(weights**2) / np.sum(weights) ** 2)


def _exposed_spread(
    values: cv2.typing.MatLike, grey: NDArray[np.uint8], parameters: ImageParameters
) -> float:
    """Estimate the spread of values over a sample of the pixels neither black nor saturated.

    Over all of the sample if too few are well exposed.
    """
    thin = max(1, math.isqrt(grey.size // parameters.noise_samples))
    every = np.s_[::thin, ::thin]
    mean = np.asarray(cv2.blur(grey, (parameters.exposure_window_px,) * 2))[every]
    exposed = (mean > parameters.black_grey_level) & (mean < parameters.white_grey_level)
    sample = np.asarray(values)[every]
    enough = exposed.mean() > parameters.min_exposed_share
    return robust_spread(sample[exposed] if enough else sample)
