"""From disparity to points in space (study, section 4.2 step 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera


def reproject(
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    rays: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None,
) -> NDArray[np.float32]:
    """Compute the position of each pixel in the left optical frame.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 or less where there is no match.
    camera : StereoCamera
    rays : tuple of two ndarray of float32, optional
        ``x / z`` and ``y / z`` of each pixel, shapes that broadcast to (height, width). Needed
        for images with lens distortion; by default those of the ideal camera.

    Returns
    -------
    ndarray of float32, shape (height, width, 3)
        x right, y down, z forward, metres; all NaN where there is no match.

    Notes
    -----
    ``Z = fx B / d``, ``X = (u - cx) Z / fx``, ``Y = (v - cy) Z / fy``. The result is that of
    ``cv2.reprojectImageTo3D`` with the corresponding Q, where the study passes 0.
    """
    with np.errstate(divide='ignore'):
        depth_m = np.float32(camera.fx * camera.baseline_m) / disparity
    depth_m[disparity <= 0] = np.nan
    x_over_z, y_over_z = camera.rays() if rays is None else rays
    points = np.empty((*disparity.shape, 3), np.float32)
    np.multiply(depth_m, x_over_z, out=points[..., 0])
    np.multiply(depth_m, y_over_z, out=points[..., 1])
    points[..., 2] = depth_m
    return points
