"""3D only: distance from a robust ground plane."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.evaluation.methods.dense_stereo import height_above, match_densely
from rover_obstacle_detection.evaluation.methods.method import Mask, as_mask


class DepthOnly:
    """Flags points more than ``max_step`` above or below the ground plane."""

    def __init__(self, config: DetectorConfig) -> None:
        self._config = config

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Find obstacles; see `Method`."""
        scene = match_densely(camera, left, right, self._config)
        if scene.plane is None:
            return np.zeros(camera.shape, np.uint8)
        height_m = height_above(scene.plane, scene.points)
        return as_mask(scene.within(self._config) & (np.abs(height_m) > self._config.max_step))
