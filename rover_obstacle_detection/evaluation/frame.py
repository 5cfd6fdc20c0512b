"""A stereo pair with its truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """A rectified pair, and what is known about each pixel of its left image.

    Parameters
    ----------
    stamp_ns : int
    camera : StereoCamera
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.
    labels : ndarray of uint8, shape (height, width)
        0 free, 1 rock, 2 slope, 3 drop, 255 not counted.
    instances : ndarray of uint16, shape (height, width)
        0 where there is no rock, else the rock's number.
    depth_m : ndarray of float32, shape (height, width), optional
        Along the optical axis; NaN where there is no surface.
    gravity : Gravity, optional
        The true vertical.
    """

    stamp_ns: int
    camera: StereoCamera
    left: NDArray[Any]
    right: NDArray[Any]
    labels: NDArray[np.uint8]
    instances: NDArray[np.uint16]
    depth_m: NDArray[np.float32] | None = None
    gravity: Gravity | None = None
