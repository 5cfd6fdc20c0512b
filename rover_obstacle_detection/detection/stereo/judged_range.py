"""The range of distances within which pixels are judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.stereo.matching import Stereo


def too_near(
    disparity: NDArray[np.float32], camera: StereoCamera, min_range_m: float
) -> NDArray[np.bool_]:
    """Find the pixels that lie nearer than a distance along the optical axis."""
    return np.asarray(disparity > np.float32(camera.disparity_at(min_range_m)))


def too_far(
    disparity: NDArray[np.float32], camera: StereoCamera, max_range_m: float
) -> NDArray[np.bool_]:
    """Find the matched pixels that lie farther than a distance along the optical axis."""
    farthest = np.float32(camera.disparity_at(max_range_m))
    return np.asarray((disparity > 0) & (disparity < farthest))


def within_range(stereo: Stereo, min_range_m: float, max_range_m: float) -> Stereo:
    """Exclude the pixels outside the range of distances from judgement.

    Parameters
    ----------
    stereo : Stereo
    min_range_m, max_range_m : float
        Along the optical axis, metres.

    Returns
    -------
    Stereo
        Nearer pixels have no match. Like the rover itself, nearer and farther pixels are neither
        free nor part of an obstacle. What is seen before ground that lies too near is too near
        itself, also without a match.
    """
    frame = stereo.frame
    near = too_near(stereo.disparity, frame.camera, min_range_m)
    before = too_near(stereo.expected, frame.camera, min_range_m) & (stereo.disparity <= 0)
    outside = near | before | too_far(stereo.disparity, frame.camera, max_range_m)
    if not outside.any():
        return stereo
    if frame.excluded is not None:
        outside |= frame.excluded
    return replace(
        stereo,
        frame=replace(frame, excluded=outside),
        disparity=np.where(near, np.float32(0), stereo.disparity),
    )
