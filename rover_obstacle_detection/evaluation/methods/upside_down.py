"""Methods that expect an upright camera, with one that is mounted upside down."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.methods.method import Mask, Method


class UpsideDown:
    """Runs a method on the upright view, as the detector does with ``upside_down``.

    Parameters
    ----------
    method : Method
    """

    def __init__(self, method: Method) -> None:
        self._method = method

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Find obstacles; see `Method`."""
        upright = (np.ascontiguousarray(image[::-1]) for image in (left, right))
        return np.ascontiguousarray(self._method(camera.mirrored(), *upright)[::-1])
