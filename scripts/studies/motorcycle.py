"""The pair ``motorcycle`` of the Middlebury 2014 benchmark, a quarter of its size."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import MissingExtraError

FOCAL_PX = 994.978
CX_PX, CY_PX = 311.193, 254.877
CX_RIGHT_MORE_PX = 31.086
BASELINE_M = 0.193001


@dataclass(frozen=True, eq=False)
class StereoWithTruth:
    """A rectified pair and its true disparity.

    Parameters
    ----------
    camera : StereoCamera
    left, right : ndarray of uint8, shape (height, width, 3)
        BGR.
    disparity : ndarray of float32, shape (height, width)
        Of the left image, pixels, the camera's offset taken off; NaN where it is not known.
    """

    camera: StereoCamera
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    disparity: NDArray[np.float32]


def load_motorcycle() -> StereoWithTruth:
    """Read the pair that comes with scikit-image, with the calibration of its documentation.

    Raises
    ------
    MissingExtraError
        If scikit-image is not installed.

    Notes
    -----
    Scharstein, Hirschmueller, Kitajima, Krathwohl, Nesic, Wang and Westling 2014. The disparity
    is the left image's: the right image shows the pixel's surface ``disparity`` columns to the
    left.
    """
    data = _library()
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
        cx_right=CX_PX + CX_RIGHT_MORE_PX,
    )
    disparity = np.where(np.isfinite(raw), raw - camera.disparity_offset, np.nan)
    bgr_left, bgr_right = (np.ascontiguousarray(eye[..., ::-1]) for eye in (left, right))
    return StereoWithTruth(camera, bgr_left, bgr_right, disparity.astype(np.float32))


def _library() -> Any:
    try:
        return importlib.import_module('skimage.data')
    except ImportError as error:
        msg = (
            'the Middlebury pair needs scikit-image, which is not installed: '
            "pip install 'rover_obstacle_detection[data]'"
        )
        raise MissingExtraError(msg) from error
