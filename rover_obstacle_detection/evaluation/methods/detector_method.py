"""The package's own detector as a method."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES, HybridStages
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.evaluation.methods.method import Mask


class DetectorMethod:
    """Runs `Detector`, making a new one when the camera changes.

    Parameters
    ----------
    config : DetectorConfig
    stages : HybridStages, optional
        Stages of the hybrid, to replace some of them.
    """

    def __init__(self, config: DetectorConfig, stages: HybridStages = HYBRID_STAGES) -> None:
        self._config = config
        self._stages = stages
        self._detector: Detector | None = None

    def detect(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Detection:
        """Find obstacles and return all intermediate products."""
        if self._detector is None or self._detector.camera != camera:
            self._detector = Detector(camera, self._config, stages=self._stages)
        return self._detector.detect(left, right)

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Find obstacles; see `Method`."""
        return self.detect(camera, left, right).mask
