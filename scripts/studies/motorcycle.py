"""The ``motorcycle`` pair of the Middlebury 2014 benchmark at a quarter of its size."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import MissingExtraError

# Calibration in the documentation of skimage.data.stereo_motorcycle.
FOCAL_PX = 994.978
CX_PX, CY_PX = 311.193, 254.877
CX_RIGHT_MINUS_LEFT_PX = 31.086
BASELINE_M = 0.193001


@dataclass(frozen=True, eq=False)
class StereoWithTruth:
    """A rectified pair with its true disparity.

    Parameters
    ----------
    camera : StereoCamera
    left, right : ndarray of uint8, shape (height, width, 3)
        BGR.
    disparity : ndarray of float32, shape (height, width)
        Of the left image, pixels, without the camera's offset; NaN where unknown.
    """

    camera: StereoCamera
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    disparity: NDArray[np.float32]


def load_motorcycle() -> StereoWithTruth:
    """Load the pair that scikit-image ships.

    Raises
    ------
    MissingExtraError
        If scikit-image is not installed.

    Notes
    -----
    Scharstein, Hirschmueller, Kitajima, Krathwohl, Nesic, Wang and Westling 2014.
    """
    try:
        data: Any = importlib.import_module('skimage.data')
    except ImportError as error:
        msg = (
            'the Middlebury pair needs scikit-image, which is not installed: '
            'pip install scikit-image'
        )
        raise MissingExtraError(msg) from error
    left, right, raw = data.stereo_motorcycle()
    height, width = raw.shape
    camera = StereoCamera(
        width=width,
        height=height,
        fx=FOCAL_PX,
        fy=FOCAL_PX,
        cx=CX_PX,
        cy=CY_PX,
        baseline_m=BASELINE_M,
        cx_right=CX_PX + CX_RIGHT_MINUS_LEFT_PX,
    )
    disparity = np.where(np.isfinite(raw), raw - camera.disparity_offset, np.nan)
    bgr_left, bgr_right = (np.ascontiguousarray(rgb[..., ::-1]) for rgb in (left, right))
    return StereoWithTruth(camera, bgr_left, bgr_right, disparity.astype(np.float32))
