"""Plain dense stereo, the front end of the methods that use geometry alone."""

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
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.stereo.semi_global import Penalties, plain_disparity

PENALTIES = Penalties(300, 1200)
# Reduction of the images in which the disparity range is estimated.
COARSE = 4
# Share of the reduced width that is searched, and the quantile of the matches taken as largest.
COARSE_RANGE_SHARE = 0.4
LARGEST_PERCENTILE = 99.9
# Margin for nearer surfaces hidden in the left border, which SGBM cannot match.
RANGE_FACTOR = 1.15
RANGE_MARGIN_PX = 4
# Largest disparity assumed when nothing matches, pixels.
FALLBACK_DISPARITY_PX = 48.0


@dataclass(frozen=True, eq=False)
class DenseScene:
    """Dense disparity and points of a pair, and its ground plane.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels; 0 where there is no match.
    points : ndarray of float32, shape (height, width, 3)
        Left optical frame, metres; NaN where there is no match.
    plane : GroundPlane or None
        None if too little was matched.
    """

    disparity: NDArray[np.float32]
    points: NDArray[np.float32]
    plane: GroundPlane | None

    def within(self, config: DetectorConfig) -> NDArray[np.bool_]:
        """Mark the pixels between ``min_range`` and ``max_range``."""
        depth_m = self.points[..., 2]
        return (depth_m >= config.min_range) & (depth_m <= config.max_range)

    def level_points(self, where: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Points of the marked pixels in a level frame centred at the left camera.

        Returns
        -------
        ndarray of float32, shape (n, 3)
            x forward, y left, z up, metres.
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
    """Match a pair with plain SGBM and fit the ground plane; see `match_plainly`."""
    disparity = match_plainly(camera, left, right, config)
    plane = fit_plane(disparity, camera, config)
    return DenseScene(disparity, reproject(disparity, camera), plane)


def match_plainly(
    camera: StereoCamera, left: NDArray[Any], right: NDArray[Any], config: DetectorConfig
) -> NDArray[np.float32]:
    """Match a pair with plain SGBM over the disparity range of the scene.

    Parameters
    ----------
    camera : StereoCamera
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.
    config : DetectorConfig

    Returns
    -------
    ndarray of float32, shape (height, width)
        Pixels, without the camera's disparity offset; 0 where there is no match.
    """
    # The hybrid's own block size is too small without its refinement.
    config = replace(config, method='study')
    grey_left, grey_right = grey_pair(left, right, camera)
    count = _disparities_in_view(grey_left, grey_right, camera, config)
    stereo = DetectorParameters.from_config(config).stereo
    return plain_disparity(grey_left, grey_right, camera, count, PENALTIES, stereo)


def fit_plane(
    disparity: NDArray[np.float32], camera: StereoCamera, config: DetectorConfig
) -> GroundPlane | None:
    """Fit the ground plane robustly, with half of ``max_step`` as tolerance."""
    plane = fit_ground_plane(
        disparity,
        camera,
        PlaneFitParameters(tolerance_m=config.max_step / 2),
        min_disparity=camera.disparity_at(config.max_range),
    )
    return None if plane is None else plane.in_space(camera, None)


def height_above(plane: GroundPlane, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Height of points above a plane, metres."""
    return points @ np.asarray(plane.normal, np.float32) + np.float32(plane.height_m)


def _disparities_in_view(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    camera: StereoCamera,
    config: DetectorConfig,
) -> int:
    size = (camera.width // COARSE, camera.height // COARSE)
    small_left, small_right = (
        np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        for image in (left, right)
    )
    small = camera.resized(*size)
    count = max(16, round(small.width * COARSE_RANGE_SHARE) // 16 * 16)
    stereo = DetectorParameters.from_config(config).stereo
    coarse = plain_disparity(small_left, small_right, small, count, PENALTIES, stereo)
    matched = coarse[coarse > 0]
    largest = FALLBACK_DISPARITY_PX
    if matched.size:
        searched = float(np.percentile(matched, LARGEST_PERCENTILE)) + small.disparity_offset
        largest = searched * COARSE * RANGE_FACTOR + RANGE_MARGIN_PX
    return max(16, min(-(-int(largest) // 16), camera.width // 32) * 16)
