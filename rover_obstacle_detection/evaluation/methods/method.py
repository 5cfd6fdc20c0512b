"""The interface of the compared methods."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera

Mask = NDArray[np.uint8]


class Method(Protocol):
    """An obstacle detector."""

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Find obstacles in a rectified pair.

        Parameters
        ----------
        camera : StereoCamera
        left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
            Grey or BGR.

        Returns
        -------
        ndarray of uint8, shape (height, width)
            0 free, 255 obstacle.
        """


def as_mask(flagged: NDArray[np.bool_]) -> Mask:
    """Convert True to 255."""
    return flagged.astype(np.uint8) * np.uint8(255)
