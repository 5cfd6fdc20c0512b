"""How well stereo measures: noise of disparity, and of height over the ground plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

DISPARITY_NOISE_PX = 0.25
WINDOW_NOISE_PX = 0.05
# So many pixels share their noise, about those of the window in which disparity is refined: a mean
# over n pixels has the noise of one over sqrt(n / SHARED_PIXELS).
SHARED_PIXELS = 100.0


def height_noise_m(
    disparity: NDArray[np.float32],
    height_m: float | NDArray[np.float32],
    noise_px: float | NDArray[np.float32],
) -> NDArray[np.float32]:
    """Estimate the standard deviation of the height above the local ground, metres.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels; 0 where there is no match.
    height_m : float or ndarray of float32, shape (height, width)
        Of the left eye over the ground, or over each point.
    noise_px : float or ndarray of float32, shape (height, width)
        Standard deviation of the disparity, pixels.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Infinite where there is no match.

    Notes
    -----
    A share ``s = sigma_d / d`` moves a point by that share along its ray, which comes down
    ``h`` on its way to the ground: ``sigma_H = h sigma_d / d = h sigma_d Z / (fx B)``.
    """
    with np.errstate(divide='ignore'):
        return np.asarray(height_m * noise_px / disparity, np.float32)
