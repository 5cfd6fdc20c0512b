"""Edges of an image at the scale of outlines."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.parameters import ImageParameters


def edge_strength(grey: NDArray[np.uint8], parameters: ImageParameters) -> NDArray[np.float32]:
    """Measure the grey-level gradient of the reduced and smoothed image.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    parameters : ImageParameters

    Returns
    -------
    ndarray of float32, shape (height / edge_reduction, width / edge_reduction), rounded up
        Grey levels per pixel of the reduced image. Smoothing widens an edge, so that an outline
        drawn one pixel beside it still lies on it.
    """
    reduction = parameters.edge_reduction
    # Each pixel of the reduced image has to cover as many pixels as any other.
    padding = ((0, -grey.shape[0] % reduction), (0, -grey.shape[1] % reduction))
    padded = np.pad(grey, padding, mode='edge') if np.any(padding) else grey
    size = padded.shape[1] // reduction, padded.shape[0] // reduction
    small = cv2.resize(padded, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    smooth = cv2.GaussianBlur(small, (0, 0), parameters.edge_smoothing_px)
    across, down = (
        cv2.Sobel(smooth, cv2.CV_32F, *order, scale=1 / 8) for order in ((1, 0), (0, 1))
    )
    # The last bit of cv2.magnitude depends on where its arrays lie in memory.
    return np.asarray(np.sqrt(across * across + down * down), np.float32)
