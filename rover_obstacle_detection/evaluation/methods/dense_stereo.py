"""Plain dense stereo, the input of the methods that look at geometry alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import PlaneFitParameters
from rover_obstacle_detection.detection.geometry.plane_fit import fit_ground_plane
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.detection.stereo.semi_global import Penalties, plain_disparity

PENALTIES = Penalties(300, 1200)
COARSE = 4


@dataclass(frozen=True, eq=False)
class DenseScene:
    """A pair matched pixel by pixel, and the plane of its ground.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels; 0 where there is no match.
    points : ndarray of float32, shape (height, width, 3)
        Left optical frame, metres; NaN where there is no match.
    plane : GroundPlane or None
        None where too little was matched to tell.
    """

    disparity: NDArray[np.float32]
    points: NDArray[np.float32]
    plane: GroundPlane | None

    def within(self, config: DetectorConfig) -> NDArray[np.bool_]:
        """Pixels with a point in the range that is judged."""
        depth_m = self.points[..., 2]
        return (depth_m >= config.min_range) & (depth_m <= config.max_range)

    def level_points(self, where: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Points of some pixels in a level frame below the camera: z upward from its centre.

        Returns
        -------
        ndarray of float32, shape (n, 3)
            x forward, y left, z up, metres, the left eye at the origin.
        """
        assert self.plane is not None
        up = np.asarray(self.plane.normal, np.float32)
        forward = np.asarray((0, 0, 1), np.float32) - up[2] * up
        forward /= np.linalg.norm(forward)
        axes = np.stack((forward, np.cross(up, forward), up))
        return np.asarray(self.points[where] @ axes.T, np.float32)


def match_densely(
    camera: StereoCamera, left: NDArray[Any], right: NDArray[Any], config: DetectorConfig
) -> DenseScene:
    """Match a pair with SGBM over the disparities that it holds, and fit the ground plane."""
    disparity = match_plainly(camera, left, right, config)
    plane = fit_plane(disparity, camera, config)
    return DenseScene(disparity, reproject(disparity, camera), plane)


def match_plainly(
    camera: StereoCamera, left: NDArray[Any], right: NDArray[Any], config: DetectorConfig
) -> NDArray[np.float32]:
    """Match a pair with plain SGBM over the disparities that it holds.

    Parameters
    ----------
    camera : StereoCamera
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.
    config : DetectorConfig

    Returns
    -------
    ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    """
    # The hybrid's blocks are smaller, for it goes on refining.
    config = replace(config, method='study')
    grey_left, grey_right = grey_pair(left, right, camera)
    count = _disparities_in_view(grey_left, grey_right, camera, config)
    return plain_disparity(grey_left, grey_right, camera, count, config, PENALTIES)


def fit_plane(
    disparity: NDArray[np.float32], camera: StereoCamera, config: DetectorConfig
) -> GroundPlane | None:
    """Fit the plane of the ground robustly; half the clearance still counts as ground."""
    plane = fit_ground_plane(
        disparity,
        camera,
        PlaneFitParameters(tolerance_m=config.max_step / 2),
        min_disparity=camera.disparity_at(config.max_range),
    )
    return None if plane is None else plane.in_space(camera, None)


def height_above(plane: GroundPlane, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Distance of points above a plane, metres."""
    return points @ np.asarray(plane.normal, np.float32) + np.float32(plane.height_m)


def _disparities_in_view(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    camera: StereoCamera,
    config: DetectorConfig,
) -> int:
    size = (camera.width // COARSE, camera.height // COARSE)
    small_left, small_right = (
        np.asarray(cv2.resize(eye, size, interpolation=cv2.INTER_AREA), np.uint8)
        for eye in (left, right)
    )
    small = camera.resized(*size)
    count = max(16, round(small.width * 0.4) // 16 * 16)
    coarse = plain_disparity(small_left, small_right, small, count, config, PENALTIES)
    matched = coarse[coarse > 0]
    # The left border is blind over the whole coarse range: the margin is for what it hides.
    largest = 48.0
    if matched.size:
        searched = float(np.percentile(matched, 99.9)) + small.disparity_offset
        largest = searched * COARSE * 1.15 + 4
    return max(16, min(-(-int(largest) // 16), camera.width // 32) * 16)
