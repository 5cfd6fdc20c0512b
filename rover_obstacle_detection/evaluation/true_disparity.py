"""Ground-truth disparity, and where both cameras show the surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera

# A surface is hidden in the right image if one nearer by at least this much covers it.
OCCLUSION_PX = 1.0


def true_disparity(depth_m: NDArray[np.float32], camera: StereoCamera) -> NDArray[np.float32]:
    """Convert true depth to disparity.

    Parameters
    ----------
    depth_m : ndarray of float32, shape (height, width)
        Depth along the optical axis; NaN where there is no surface.
    camera : StereoCamera

    Returns
    -------
    ndarray of float32, shape (height, width)
        Pixels, without the camera's disparity offset; NaN where there is no surface.
    """
    return np.asarray(np.float32(camera.fx * camera.baseline_m) / depth_m, np.float32)


def visible_in_both(truth: NDArray[np.float32], camera: StereoCamera) -> NDArray[np.bool_]:
    """Mark the left-image pixels whose surface is also visible in the right image.

    Parameters
    ----------
    truth : ndarray of float32, shape (height, width)
        True disparity, pixels, without the camera's offset; NaN where unknown.
    camera : StereoCamera

    Returns
    -------
    ndarray of bool, shape (height, width)
        Inside the right image, and not occluded: no pixel of the same row falls on the same
        right-image column with a disparity greater by more than 1 px.
    """
    height, width = truth.shape
    with np.errstate(invalid='ignore'):
        column = np.arange(width)[np.newaxis] - truth - camera.disparity_offset
        inside = (column >= 0) & (column <= width - 1)
    place = np.rint(np.where(inside, column, 0)).astype(np.intp)
    place += width * np.arange(height)[:, np.newaxis]
    nearest = np.full(height * width, -np.inf, np.float32)
    np.maximum.at(nearest, place[inside], truth[inside])
    with np.errstate(invalid='ignore'):
        return np.asarray(inside & (truth >= nearest[place] - OCCLUSION_PX))
