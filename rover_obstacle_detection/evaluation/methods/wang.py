"""The sparse pipeline of Wang et al. (2019), as section 4.1 of the study describes it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.grey_level import dark_regions
from rover_obstacle_detection.detection.image import grey_pair
from rover_obstacle_detection.detection.morphology import close_then_open
from rover_obstacle_detection.detection.regions import region_means, seed_regions
from rover_obstacle_detection.detection.reprojection import reproject
from rover_obstacle_detection.detection.segmentation import mean_shift_regions
from rover_obstacle_detection.detection.terrain import (
    elevation_along,
    window_roughness,
    window_step,
)
from rover_obstacle_detection.evaluation.methods.dense_stereo import fit_plane
from rover_obstacle_detection.evaluation.methods.method import Mask, as_mask
from rover_obstacle_detection.evaluation.methods.sparse_stereo import (
    correlate_points,
    guided_disparity,
    without_outliers,
)

GRID = 4
WINDOW_POINTS = 5
MAX_ROUGHNESS_SHARE = 0.05
MAX_STEP_SHARE = 0.5


class Wang:
    """Interest points, guided matching, regions, then roughness and step, or grey level.

    The study gives no numbers for the original; here 3D points lie on a grid of 4 pixels, a
    window holds 5 x 5 of them, and a region is an obstacle where the mean roughness of its windows
    is over a twentieth of ``max_step``, or their mean step over half of it. T1, T4, the
    bandwidths and the morphology are the study's.
    """

    def __init__(self, config: DetectorConfig) -> None:
        self._config = config

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Find obstacles; see `Method`."""
        config = self._config
        grey, grey_right = grey_pair(left, right, camera)
        disparity = self._sparse_disparity(grey, grey_right, camera)
        regions = mean_shift_regions(
            grey,
            config.mean_shift_spatial_radius,
            config.mean_shift_color_radius,
            config.min_region_size,
        )
        is_seed = seed_regions(regions, disparity > 0, config.min_seed_points)
        flagged = dark_regions(grey, regions, is_seed, config.dark_grey_level)
        flagged |= is_seed & self._rises(disparity, regions, camera)
        return close_then_open(
            as_mask(flagged[regions]), config.morphology_size, config.morphology_iterations
        )

    def _sparse_disparity(
        self, left: NDArray[np.uint8], right: NDArray[np.uint8], camera: StereoCamera
    ) -> NDArray[np.float32]:
        matches = correlate_points(left, right, camera, self._config.min_range)
        dense = guided_disparity(left, right, camera, without_outliers(matches))
        dense[dense < camera.disparity_at(self._config.max_range)] = 0
        sparse = np.zeros_like(dense)
        sparse[::GRID, ::GRID] = dense[::GRID, ::GRID]
        return sparse

    def _rises(
        self, disparity: NDArray[np.float32], regions: NDArray[np.int32], camera: StereoCamera
    ) -> NDArray[np.bool_]:
        """Tell the regions that are rough or stepped."""
        plane = fit_plane(disparity, camera, self._config)
        if plane is None:
            return np.zeros(int(regions.max()) + 1, bool)
        size = GRID * (WINDOW_POINTS - 1) + 1
        elevation_m = elevation_along(reproject(disparity, camera), plane.up_vector)
        max_step_m = self._config.max_step
        roughness = _mean_where_known(regions, window_roughness(disparity, camera, size))
        step = _mean_where_known(regions, window_step(elevation_m, size))
        rough = roughness > MAX_ROUGHNESS_SHARE * max_step_m
        return np.asarray(rough | (step > MAX_STEP_SHARE * max_step_m))


def _mean_where_known(
    regions: NDArray[np.int32], values: NDArray[np.float32]
) -> NDArray[np.float64]:
    known = np.isfinite(values)
    share = region_means(regions, known)
    return region_means(regions, np.where(known, values, 0)) / np.maximum(share, 1e-9)
