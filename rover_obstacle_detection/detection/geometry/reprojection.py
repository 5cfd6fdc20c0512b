"""Disparity to points in space (study, section 4.2 step 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera


def reproject(disparity: NDArray[np.float32], camera: StereoCamera) -> NDArray[np.float32]:
    """Position of each pixel in the left optical frame.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 or less where there is no match.
    camera : StereoCamera

    Returns
    -------
    ndarray of float32, shape (height, width, 3)
        x right, y down, z forward, metres; NaN in all three where there is no match.

    Notes
    -----
    ``Z = fx B / d``, ``X = (u - cx) Z / fx``, ``Y = (v - cy) Z / fy``: what
    ``cv2.reprojectImageTo3D`` does with a Q matrix of these numbers, which the study passed as 0.
    """
    with np.errstate(divide='ignore'):
        depth_m = np.float32(camera.fx * camera.baseline_m) / disparity
    depth_m[disparity <= 0] = np.nan
    x_over_z, y_over_z = camera.rays()
    points = np.empty((*disparity.shape, 3), np.float32)
    np.multiply(depth_m, x_over_z, out=points[..., 0])
    np.multiply(depth_m, y_over_z, out=points[..., 1])
    points[..., 2] = depth_m
    return points
