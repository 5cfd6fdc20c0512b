"""Even contrast in light and shadow, for matching."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.brightness import (
    Levels,
    Spread,
    grey_level_shares,
)
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.parameters import ImageParameters


def with_even_contrast(
    pair: GreyPair, gradient: Spread, noise_gradient: Levels, parameters: ImageParameters
) -> GreyPair:
    """Raise the contrast of the shadows to that of the whole image.

    Semi-global matching has one set of penalties. Those that suit what is lit flatten what lies in
    shadow, where the same texture has less contrast.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    gradient : Spread
        Of the left image.
    noise_gradient : ndarray of float32, shape (256,)
        What it would be at each brightness without any texture.
    parameters : ImageParameters

    Returns
    -------
    tuple of two ndarray of uint8, shape (height, width)
        The pair itself if no shadow needs it.
    """
    shares = grey_level_shares(pair[0], parameters)
    curve = tone_curve(shares, gradient, noise_gradient, parameters)
    if curve is None:
        return pair
    left, right = (np.asarray(cv2.LUT(image, curve), np.uint8) for image in pair)
    return left, right


def tone_curve(
    shares: Levels, gradient: Spread, noise_gradient: Levels, parameters: ImageParameters
) -> NDArray[np.uint8] | None:
    """Choose the grey level that replaces each.

    Parameters
    ----------
    shares : ndarray of float32, shape (256,)
        Share of the pixels that have each grey level.
    gradient : Spread
    noise_gradient : ndarray of float32, shape (256,)
    parameters : ImageParameters

    Returns
    -------
    ndarray of uint8, shape (256,) or None
        Never falling, and 0 only for black. None if there is nothing to raise.
    """
    reached = np.cumsum(shares)
    median = int(np.searchsorted(reached, 0.5))
    textured = gradient.by_brightness > parameters.min_texture_ratio * noise_gradient
    uneven = gradient.overall / gradient.by_brightness / parameters.even_contrast_ratio
    gain = np.clip(uneven, 1, parameters.max_shadow_gain)
    gain[~textured] = 1
    gain[math.ceil(parameters.shadow_brightness * median) :] = 1
    if gain.max() == 1:
        return None
    curve = np.cumsum(gain) - gain[0]
    brightest = curve[min(int(np.searchsorted(reached, parameters.unclipped_share)), 255)]
    curve *= min(1.0, 255 / max(float(brightest), 1.0))
    curve[1:] = np.clip(np.rint(curve[1:]), 1, 255)
    return np.asarray(curve, np.uint8)
