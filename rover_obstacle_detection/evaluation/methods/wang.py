"""The sparse pipeline of Wang et al. (2019) after section 4.1 of the study."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.detection.regions.grey_level import dark_regions
from rover_obstacle_detection.detection.regions.regions import seed_regions
from rover_obstacle_detection.detection.regions.segmentation import mean_shift_regions
from rover_obstacle_detection.detection.study.limits import exceeds_terrain_limits
from rover_obstacle_detection.detection.study.morphology import close_then_open
from rover_obstacle_detection.detection.study.parameters import StudyParameters
from rover_obstacle_detection.detection.study.window_terrain import (
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

# 3D points lie on a grid of this spacing, pixels; a window holds 5 x 5 of them.
GRID = 8
WINDOW_POINTS = 5
# Limits as shares of ``max_step``, chosen on the sample scenes: the study gives none.
MAX_ROUGHNESS_SHARE = 0.1
MAX_STEP_SHARE = 0.6


class Wang:
    """Sparse matching, guided matching, regions, then roughness and step, or grey level.

    As in the study, a seed region is flagged where the roughness or step of its windows exceeds
    the limit by more than the noise. T1, T4, the bandwidths and the morphology are the study's.
    Windows are flagged one by one because most rocks share a region with their ground.
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
        dark = dark_regions(grey, regions, is_seed, config.dark_grey_level)
        flagged = dark[regions] | (is_seed[regions] & self._rises(disparity, camera))
        return close_then_open(
            as_mask(flagged), config.morphology_size, config.morphology_iterations
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

    def _rises(self, sparse: NDArray[np.float32], camera: StereoCamera) -> NDArray[np.bool_]:
        """Mark the pixels around which the ground is rough or stepped."""
        plane = fit_plane(sparse, camera, self._config)
        if plane is None:
            return np.zeros(camera.shape, bool)
        grid = _grid_camera(camera)
        disparity = sparse[::GRID, ::GRID] / np.float32(GRID)
        elevation_m = elevation_along(reproject(disparity, grid), plane.up_vector)
        max_step_m = self._config.max_step
        limits = StudyParameters(
            max_roughness_m=MAX_ROUGHNESS_SHARE * max_step_m,
            max_step_m=MAX_STEP_SHARE * max_step_m,
        )
        rises = exceeds_terrain_limits(
            window_roughness(disparity, grid, WINDOW_POINTS),
            window_step(elevation_m, WINDOW_POINTS),
            disparity * np.float32(GRID),
            elevation_m,
            limits,
        )
        rows, columns = (
            np.minimum((np.arange(size) + GRID // 2) // GRID, of - 1)
            for size, of in zip(camera.shape, rises.shape, strict=True)
        )
        return np.asarray(rises[np.ix_(rows, columns)])


def _grid_camera(camera: StereoCamera) -> StereoCamera:
    """Camera whose pixels are the grid points."""
    assert camera.cx_right is not None
    return StereoCamera(
        width=-(-camera.width // GRID),
        height=-(-camera.height // GRID),
        fx=camera.fx / GRID,
        fy=camera.fy / GRID,
        cx=camera.cx / GRID,
        cy=camera.cy / GRID,
        baseline_m=camera.baseline_m,
        cx_right=camera.cx_right / GRID,
    )
