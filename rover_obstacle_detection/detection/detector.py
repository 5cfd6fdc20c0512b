"""The detector: a camera and a configuration in, image pairs through, detections out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.allocation import keep_freed_memory
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.images.empty_border import empty_border
from rover_obstacle_detection.detection.images.grey_pair import equalized, grey_pair
from rover_obstacle_detection.detection.methods.hybrid import detect_hybrid
from rover_obstacle_detection.detection.methods.stages import HYBRID_STAGES, HybridStages
from rover_obstacle_detection.detection.methods.study import detect_as_study
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.detection.result.upside_down import in_recorded_images
from rover_obstacle_detection.errors import CameraError, ImageError

OnStage = Callable[[str], None]

MIN_SIDE_PX = 16


class Detector:
    """Finds obstacles in rectified stereo pairs of one camera.

    Parameters
    ----------
    camera : StereoCamera
    config : DetectorConfig, optional
    rover_mask : ndarray of bool, shape (height, width), optional
        True where the left image shows the rover itself: never judged, never an obstacle.
    stages : HybridStages, optional
        Stages of the hybrid method, to replace some of them.
    parameters : DetectorParameters, optional
        Parameters of all stages, instead of a configuration.

    Raises
    ------
    CameraError
        If it is no camera, or the images have fewer than 16 rows or columns.
    ImageError
        If the rover mask has another size than the camera.
    """

    def __init__(
        self,
        camera: StereoCamera,
        config: DetectorConfig | None = None,
        rover_mask: NDArray[np.bool_] | None = None,
        stages: HybridStages = HYBRID_STAGES,
        parameters: DetectorParameters | None = None,
    ) -> None:
        if not isinstance(camera, StereoCamera):
            msg = f'camera is {type(camera).__name__}: expected a StereoCamera'
            raise CameraError(msg)
        if min(camera.shape) < MIN_SIDE_PX:
            msg = (
                f'images are {camera.width} x {camera.height} pixels: expected at least '
                f'{MIN_SIDE_PX} x {MIN_SIDE_PX}'
            )
            raise CameraError(msg)
        self.camera = camera
        self._parameters = parameters or DetectorParameters.from_config(config or DetectorConfig())
        self.config = self._parameters.config
        if rover_mask is not None and rover_mask.shape != camera.shape:
            msg = (
                f'rover mask has shape {rover_mask.shape}: expected {camera.shape}, the height '
                'and width of the images'
            )
            raise ImageError(msg)
        self.rover_mask = rover_mask
        self._stages = stages
        keep_freed_memory()

    def detect(
        self,
        left: NDArray[Any],
        right: NDArray[Any],
        *,
        gravity: Gravity | None = None,
        on_stage: OnStage | None = None,
    ) -> Detection:
        """Find the obstacles of one pair.

        Parameters
        ----------
        left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
            Rectified, grey or BGR. A border of either that rectification left black is neither
            free nor an obstacle.
        gravity : Gravity, optional
            The vertical of this pair in the left optical frame, from an IMU or TF; by default as
            configured.
        on_stage : callable, optional
            Called with the name of each stage when it ends, for timing.

        Raises
        ------
        ImageError
            If an image has another size than the camera, or is not an image.
        UnjudgeablePairError
            If the pair says nothing about the ground, or contradicts itself (method `hybrid`).
        """
        pair = grey_pair(left, right, self.camera)
        unseen = self._unseen(pair[0])
        if self.config.equalize_histogram:
            pair = equalized(pair)
        finished = on_stage or _ignore
        frame = Frame(pair, self.camera, gravity or self._configured_gravity(), unseen)
        if not self.config.upside_down:
            finished('grey')
            return self._detect_upright(frame, finished)
        frame = frame.mirrored()
        finished('grey')
        return in_recorded_images(self._detect_upright(frame, finished), self.camera)

    def _unseen(self, left: NDArray[np.uint8]) -> NDArray[np.bool_] | None:
        """Return the pixels that show no ground whatever is matched there."""
        stereo = self._parameters.stereo
        empty = empty_border(left, stereo.empty_block_px, stereo.empty_rim_px)
        if empty is None or self.rover_mask is None:
            return self.rover_mask if empty is None else empty
        return empty | self.rover_mask

    def _detect_upright(self, frame: Frame, finished: OnStage) -> Detection:
        if self.config.method == 'study':
            return detect_as_study(frame, self._parameters, finished)
        return detect_hybrid(frame, self._parameters, finished, self._stages)

    def _configured_gravity(self) -> Gravity | None:
        if self.config.gravity_source != 'parameters':
            return None
        config = self.config
        roll_deg = config.camera_roll + (180.0 if config.upside_down else 0.0)
        return Gravity.from_angles(config.camera_pitch, roll_deg)


def _ignore(stage: str) -> None:
    pass
