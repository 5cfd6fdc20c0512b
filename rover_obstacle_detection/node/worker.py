"""The detection thread: takes the newest pair and publishes the result."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import (
    CameraError,
    ImageError,
    ObstacleDetectionError,
    UnjudgeablePairError,
)
from rover_obstacle_detection.messages.image import OVERSIZE, decode_camera_image
from rover_obstacle_detection.node.calibration import Calibrated, LiveCalibration
from rover_obstacle_detection.node.mailbox import Mailbox
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.statistics import DetectionFigures, NodeStatistics
from rover_obstacle_detection.swapped_images import detect_unswapped

# `stop` waits for a running detection; one that hangs must not keep the node from exiting.
STOP_TIMEOUT_S = 20.0
# After a start or an idle period, the first pair can overtake its camera_info.
CALIBRATION_TIMEOUT_S = 0.2


class ImagePair(NamedTuple):
    """A pair of messages, not yet decoded.

    Parameters
    ----------
    left, right : sensor_msgs/Image or CompressedImage
    arrival_s : float
        Monotonic time at which the second of them arrived.
    fault : str
        Why the pair must not be judged; empty if it may be.
    """

    left: Any
    right: Any
    arrival_s: float
    fault: str = ''


class Publishes(Protocol):
    """The part of `OutputPublishers` that the worker needs."""

    def publish(self, detection: Detection, header: Any) -> None:
        """Publish the outputs of a detection."""

    def publish_unknown(self, shape: tuple[int, int], config: DetectorConfig, header: Any) -> None:
        """Publish that nothing is known of a pair."""


@dataclass(frozen=True)
class Sources:
    """What a detection depends on besides the pair; read again for each pair.

    Parameters
    ----------
    settings : callable
        Returns the current settings.
    gravity : callable
        Returns gravity for a left image's header, or None to estimate it.
    topics : callable
        Returns the full names of the two image topics.
    """

    settings: Callable[[], Settings]
    gravity: Callable[[Any], Gravity | None]
    topics: Callable[[], tuple[str, str]]


class DetectionWorker:
    """Runs the detector on the newest pair in a thread of its own.

    Parameters
    ----------
    sources : Sources
    calibration : LiveCalibration
    outputs : OutputPublishers
    statistics : NodeStatistics
    warn : callable
        Logs why a frame was unusable.
    """

    def __init__(
        self,
        sources: Sources,
        *,
        calibration: LiveCalibration,
        outputs: Publishes,
        statistics: NodeStatistics,
        warn: Callable[[str], object],
    ) -> None:
        self._sources = sources
        self._calibration = calibration
        self._outputs = outputs
        self._statistics = statistics
        self._warn = warn
        self._detector: tuple[StereoCamera, Settings, Detector] | None = None
        self._started_s: float | None = None
        self._mailbox: Mailbox[ImagePair] = Mailbox(statistics.drop)
        self._thread = threading.Thread(target=self._run, name='detection', daemon=True)
        self._thread.start()

    @property
    def detecting_s(self) -> float:
        """How long the current pair has been processed (s); 0 between pairs."""
        started_s = self._started_s
        return 0.0 if started_s is None else time.monotonic() - started_s

    def submit(self, pair: ImagePair) -> None:
        """Queue a pair in place of one that still waits; returns at once."""
        self._mailbox.put(pair)

    def stop(self) -> None:
        """End the thread after the running detection."""
        self._mailbox.close()
        self._thread.join(STOP_TIMEOUT_S)

    def _run(self) -> None:
        while (pair := self._mailbox.take()) is not None:
            self._started_s = time.monotonic()
            calibrated = self._calibration.wait_for_camera(CALIBRATION_TIMEOUT_S)
            if calibrated is None:
                problem = self._calibration.state[1]
                self._statistics.bad_frame('no calibration', problem)
                self._warn(problem)
            else:
                try:
                    self._process(pair, calibrated)
                except Exception as error:
                    # Any error costs one pair, not the node.
                    self._fail(pair, calibrated.camera, error)
            self._started_s = None

    def _fail(self, pair: ImagePair, camera: StereoCamera, error: Exception) -> None:
        reason, problem, log = _describe(error)
        try:
            self._publish_unknown(camera, pair.left.header)
        except Exception as second:
            self._warn(f'nothing is published for a failed pair: {_describe(second)[2]}')
        self._statistics.bad_frame(reason, problem)
        self._warn(log)

    def _publish_unknown(self, camera: StereoCamera, header: Any) -> None:
        config = self._sources.settings().config
        self._outputs.publish_unknown(camera.shape, config, header)

    def _process(self, pair: ImagePair, calibrated: Calibrated) -> None:
        header, camera, rectify = pair.left.header, calibrated.camera, calibrated.rectify
        if pair.fault:
            self._publish_unknown(camera, header)
            self._statistics.withheld(pair.fault)
            return
        left_topic, right_topic = self._sources.topics()
        most_pixels = OVERSIZE * camera.width * camera.height
        left = decode_camera_image(pair.left, left_topic, most_pixels)
        right = decode_camera_image(pair.right, right_topic, most_pixels)
        self._check_sizes(left, right, camera)
        if rectify is not None:
            left, right = rectify(left, right)
        gravity = self._sources.gravity(header)
        detector = self._detector_for(camera)
        detection = detect_unswapped(
            detector, left, right, left_topic, right_topic, gravity=gravity
        )
        self._outputs.publish(detection, header)
        source = self._sources.settings().config.gravity_source
        has_vertical = gravity is not None or source == 'parameters'
        self._statistics.detection(
            time.monotonic() - pair.arrival_s,
            _figures(detection, camera, has_vertical=has_vertical),
            detection.warnings,
        )
        for warning in detection.warnings:
            self._warn(warning)

    def _check_sizes(self, left: NDArray[Any], right: NDArray[Any], camera: StereoCamera) -> None:
        left_topic, right_topic = self._sources.topics()
        size, right_size = left.shape[1::-1], right.shape[1::-1]
        if size != right_size:
            msg = (
                f'{left_topic}: width x height is {size[0]} x {size[1]}: expected '
                f'{right_size[0]} x {right_size[1]}, as on {right_topic}'
            )
            raise ImageError(msg)
        if size != (camera.width, camera.height):
            msg = (
                f'{left_topic}: width x height is {size[0]} x {size[1]}: expected '
                f'{camera.width} x {camera.height}, as in camera_info'
            )
            raise ImageError(msg)

    def _detector_for(self, camera: StereoCamera) -> Detector:
        settings = self._sources.settings()
        if self._detector is None or self._detector[:2] != (camera, settings):
            mask = settings.rover_mask
            pixels = None if mask is None else mask.pixels(camera.height, camera.width)
            try:
                detector = Detector(camera, settings.config, pixels)
            except CameraError as error:
                raise CameraError(f'{", ".join(self._sources.topics())}: {error}') from None
            self._detector = camera, settings, detector
        return self._detector[2]


def _describe(error: Exception) -> tuple[str, str, str]:
    """Return an error's short name, one line for the diagnostics, and the text for the log."""
    if isinstance(error, UnjudgeablePairError):
        return 'unjudgeable pair', str(error), str(error)
    kind = type(error)
    if isinstance(error, ObstacleDetectionError):
        return kind.__name__, str(error), str(error)
    # With its module, because OpenCV's is called error.
    name = kind.__name__ if kind.__module__ == 'builtins' else f'{kind.__module__}.{kind.__name__}'
    problem = f'{name}: {" ".join(str(error).split())}'
    lines = ''.join(traceback.format_exception(error))
    return name, problem, f'detection failed: {problem}\n{lines}'


def _figures(
    detection: Detection, camera: StereoCamera, *, has_vertical: bool
) -> DetectionFigures:
    ground = detection.ground
    return DetectionFigures(
        valid_share=np.count_nonzero(detection.disparity > 0) / detection.disparity.size,
        obstacle_share=np.count_nonzero(detection.mask) / detection.mask.size,
        rows_off_px=detection.alignment.most_px(camera),
        lens_bend_px=detection.lenses.mean_bend_px(camera),
        camera_height_m=ground.height_m if ground.measured else None,
        camera_pitch_deg=ground.pitch_deg if ground.measured or has_vertical else None,
    )
