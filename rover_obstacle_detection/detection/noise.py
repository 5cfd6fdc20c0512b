"""How well stereo measures: noise of disparity, and of height over the ground plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.gravity import GroundPlane

DISPARITY_NOISE_PX = 0.25
WINDOW_NOISE_PX = 0.05


def height_noise_m(
    disparity: NDArray[np.float32],
    expected: NDArray[np.float32],
    ground: GroundPlane,
    noise_px: float,
) -> NDArray[np.float32]:
    """Give the standard deviation of the height over the plane, metres.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels; 0 where there is no match.
    expected : ndarray of float32, shape (height, width)
        Disparity of the plane, pixels.
    ground : GroundPlane
    noise_px : float
        Standard deviation of the disparity, pixels.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Infinite or NaN where there is no match.

    Notes
    -----
    From ``H = h (d - d_plane) / d``: ``sigma_H = h sigma_d d_plane / d^2``. On the ground that is
    ``h sigma_d Z / (fx B)``: with the range, where depth itself has ``Z^2``.
    """
    with np.errstate(divide='ignore', invalid='ignore'):
        return np.asarray(
            np.float32(ground.height_m * noise_px)
            * np.maximum(expected, 0)
            / (disparity * disparity),
            np.float32,
        )
