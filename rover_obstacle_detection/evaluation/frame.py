"""A stereo pair with ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """A rectified stereo pair with ground truth for each pixel of the left image.

    Parameters
    ----------
    stamp_ns : int
    camera : StereoCamera
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.
    labels : ndarray of uint8, shape (height, width)
        0 free, 1 rock, 2 slope, 3 drop, 255 not counted.
    instances : ndarray of uint16, shape (height, width)
        Number of the rock; 0 elsewhere.
    depth_m : ndarray of float32, shape (height, width), optional
        Depth along the optical axis; NaN where there is no surface.
    gravity : Gravity, optional
        True vertical.
    """

    stamp_ns: int
    camera: StereoCamera
    left: NDArray[Any]
    right: NDArray[Any]
    labels: NDArray[np.uint8]
    instances: NDArray[np.uint16]
    depth_m: NDArray[np.float32] | None = None
    gravity: Gravity | None = None
