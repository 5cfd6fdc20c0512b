"""Lidar ground filters on the stereo point cloud."""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.evaluation.methods.dense_stereo import match_densely
from rover_obstacle_detection.evaluation.methods.method import Mask

# Points within this share of ``max_step`` of the filter's ground belong to it. Better than 1 on
# the sample scenes: the foot of a rock is lower than its top.
GROUND_SHARE_OF_STEP = 0.7
PATCHWORK_MIN_RANGE_M = 0.1
# Patchwork++'s zones end at this multiple of the rover's range; its lidar default of 80 m is
# worse on the sample scenes.
PATCHWORK_RANGE_FACTOR = 2.0
# Cloth grid spacing, metres: as fine as the clearance.
CLOTH_CELL_M = 0.1
CLOTH_ITERATIONS = 500
CLOTH_RIGIDNESS = 1


class GroundFilter:
    """Base class of methods that flag what a ground filter leaves of a level cloud."""

    def __init__(self, config: DetectorConfig) -> None:
        self._config = config

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Find obstacles; see `Method`."""
        scene = match_densely(camera, left, right, self._config)
        mask = np.zeros(camera.shape, np.uint8)
        where = scene.within(self._config)
        if scene.plane is None or not where.any():
            return mask
        cloud = scene.level_points(where)
        mask[where] = 255 * self._is_off_ground(cloud, scene.plane.height_m).astype(np.uint8)
        return mask

    def _is_off_ground(self, cloud: NDArray[np.float32], height_m: float) -> NDArray[np.bool_]:
        raise NotImplementedError


class Patchwork(GroundFilter):
    """Patchwork++ (Lee, Lim, Myung 2022) without reflected-noise removal, a lidar feature."""

    def __init__(self, config: DetectorConfig) -> None:
        super().__init__(config)
        self._library = _library('patchwork', 'pypatchworkpp', 'pypatchworkpp')

    def _is_off_ground(self, cloud: NDArray[np.float32], height_m: float) -> NDArray[np.bool_]:
        parameters = self._library.Parameters()
        parameters.sensor_height = height_m
        parameters.min_range = PATCHWORK_MIN_RANGE_M
        parameters.max_range = PATCHWORK_RANGE_FACTOR * self._config.max_range
        parameters.th_dist = GROUND_SHARE_OF_STEP * self._config.max_step
        parameters.enable_RNR = False
        parameters.verbose = False
        with _silent_stdout():
            filter_ = self._library.patchworkpp(parameters)
            filter_.estimateGround(np.ascontiguousarray(cloud))
        off_ground = np.zeros(len(cloud), bool)
        off_ground[np.asarray(filter_.getNongroundIndices(), np.intp)] = True
        return off_ground


class Cloth(GroundFilter):
    """Cloth simulation filter (Zhang et al. 2016)."""

    def __init__(self, config: DetectorConfig) -> None:
        super().__init__(config)
        self._library = _library('cloth', 'CSF', 'cloth-simulation-filter')

    def _is_off_ground(self, cloud: NDArray[np.float32], height_m: float) -> NDArray[np.bool_]:
        ground, off = self._library.VecInt(), self._library.VecInt()
        with _silent_stdout():
            cloth = self._library.CSF()
            cloth.params.bSloopSmooth = False
            cloth.params.cloth_resolution = CLOTH_CELL_M
            cloth.params.rigidness = CLOTH_RIGIDNESS
            cloth.params.interations = CLOTH_ITERATIONS
            cloth.params.class_threshold = GROUND_SHARE_OF_STEP * self._config.max_step
            cloth.setPointCloud(cloud.astype(np.float64))
            cloth.do_filtering(ground, off, False)
        off_ground = np.zeros(len(cloud), bool)
        off_ground[np.asarray(off, np.intp)] = True
        return off_ground


def _library(method: str, module: str, package: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        msg = f'method {method} needs {package}, which is not installed: pip install {package}'
        raise MissingExtraError(msg) from error


@contextlib.contextmanager
def _silent_stdout() -> Iterator[None]:
    # Both libraries print from C++, bypassing sys.stdout.
    sys.stdout.flush()
    saved = os.dup(1)
    with Path(os.devnull).open('w') as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(saved, 1)
            os.close(saved)
