"""Intermediate results of the study's method, for its decision and for the debug pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.regions.regions import seed_regions
from rover_obstacle_detection.detection.study.parameters import StudyParameters
from rover_obstacle_detection.detection.study.window_terrain import (
    elevation_along,
    window_roughness,
    window_step,
)

Array = TypeVar('Array', bound=NDArray[Any])


@dataclass(frozen=True, eq=False)
class StudyProducts:
    """Intermediate results of one image pair, each computed on first access.

    Results are read-only arrays.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        Left image.
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    camera : StereoCamera
    up : ndarray of float32, shape (3,)
        Unit vector against gravity in the left optical frame.
    segment : callable
        Divides a grey image into regions: int32 of its shape, 1 and up.
    study : StudyParameters
    min_seed_points : int
        Fewest 3D points of a seed region (T1).
    """

    grey: NDArray[np.uint8]
    disparity: NDArray[np.float32]
    camera: StereoCamera
    up: NDArray[np.float32]
    segment: Callable[[NDArray[np.uint8]], NDArray[np.int32]]
    study: StudyParameters
    min_seed_points: int

    @cached_property
    def regions(self) -> NDArray[np.int32]:
        """Region of each pixel, 1 and up: int32, shape (height, width)."""
        return _read_only(self.segment(self.grey))

    @cached_property
    def is_seed(self) -> NDArray[np.bool_]:
        """Regions with enough 3D points: bool, shape (regions + 1,). Entry 0 is unused."""
        return _read_only(seed_regions(self.regions, self.disparity > 0, self.min_seed_points))

    @cached_property
    def seeds(self) -> NDArray[np.bool_]:
        """Pixels of the seed regions: bool, shape (height, width)."""
        return _read_only(self.is_seed[self.regions])

    @cached_property
    def elevation_m(self) -> NDArray[np.float32]:
        """Elevation relative to the left camera, metres; NaN where there is no 3D.

        Array of float32, shape (height, width).
        """
        return _read_only(elevation_along(reproject(self.disparity, self.camera), self.up))

    @cached_property
    def roughness(self) -> NDArray[np.float32]:
        """Roughness of the window around each pixel, metres; NaN where it is unknown.

        Array of float32, shape (height, width).
        """
        return _read_only(window_roughness(self.disparity, self.camera, self.study.window_size_px))

    @cached_property
    def step(self) -> NDArray[np.float32]:
        """Elevation step in the window around each pixel, metres; NaN where it is unknown.

        Array of float32, shape (height, width).
        """
        return _read_only(window_step(self.elevation_m, self.study.window_size_px))


def _read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array
