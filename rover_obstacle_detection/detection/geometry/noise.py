"""From disparity noise to height noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def height_noise_m(
    disparity: NDArray[np.float32],
    descent_m: float | NDArray[np.float32],
    noise_px: float | NDArray[np.float32],
) -> NDArray[np.float32]:
    """Estimate the standard deviation of the height above the ground, metres.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels; 0 where there is no match.
    descent_m : float or ndarray of float32, shape (height, width)
        How far the ray descends from the left camera to the ground (`lever_m` of the terrain).
    noise_px : float or ndarray of float32, shape (height, width)
        Standard deviation of the disparity, pixels.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Infinite where there is no match.

    Notes
    -----
    A relative disparity error ``s = sigma_d / d`` moves a point by the same share along its ray.
    The ray descends by ``h`` to the ground: ``sigma_H = h sigma_d / d = h sigma_d Z / (fx B)``.
    """
    with np.errstate(divide='ignore'):
        return np.asarray(descent_m * noise_px / disparity, np.float32)
