"""The thread that detects: newest pair in, messages out, whatever the pair is like."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import ImageError, ObstacleDetectionError
from rover_obstacle_detection.messages.image import decode_any_image
from rover_obstacle_detection.node.calibration import LiveCalibration
from rover_obstacle_detection.node.image_pair import ImagePair
from rover_obstacle_detection.node.mailbox import Mailbox
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.statistics import NodeStatistics
from rover_obstacle_detection.swapped_images import refuse_swapped_images

# A detection that runs is waited for; one that hangs does not keep the node from ending.
PATIENCE_S = 20.0
# The first pair after a start or a rest may overtake the camera_info that was sent with it.
CALIBRATION_PATIENCE_S = 0.2


class Publishes(Protocol):
    """What the worker needs of `OutputPublishers`."""

    def publish(self, detection: Detection, header: Any) -> None:
        """Send what is wanted of a detection."""


@dataclass(frozen=True)
class Sources:
    """What a detection depends on beside the pair; asked for anew with every pair.

    Parameters
    ----------
    settings : callable
        The settings in force.
    gravity : callable
        The vertical for a header of a left image, or None for the detector's own.
    topics : callable
        Full names of the two image topics.
    """

    settings: Callable[[], Settings]
    gravity: Callable[[Any], Gravity | None]
    topics: Callable[[], tuple[str, str]]


class DetectionWorker:
    """Detects in a thread of its own, always the newest pair.

    Parameters
    ----------
    sources : Sources
    calibration : LiveCalibration
    outputs : OutputPublishers
    statistics : NodeStatistics
    warn : callable
        Takes a line that says why a frame could not be used.
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
        self._mailbox: Mailbox[ImagePair] = Mailbox(statistics.drop)
        self._thread = threading.Thread(target=self._run, name='detection', daemon=True)
        self._thread.start()

    def submit(self, pair: ImagePair) -> None:
        """Leave a pair for detection, in place of one that still waits; returns at once."""
        self._mailbox.put(pair)

    def stop(self) -> None:
        """End the thread, after the detection that it is at."""
        self._mailbox.close()
        self._thread.join(PATIENCE_S)

    def _run(self) -> None:
        while (pair := self._mailbox.take()) is not None:
            try:
                self._process(pair)
            except ObstacleDetectionError as error:
                self._statistics.bad_frame(type(error).__name__)
                self._warn(str(error))
            except Exception as error:
                # The rover needs the next mask more than an end with this one's traceback.
                self._statistics.bad_frame(type(error).__name__)
                self._warn(f'detection failed: {traceback.format_exc()}')

    def _process(self, pair: ImagePair) -> None:
        camera = self._calibration.wait_for_camera(CALIBRATION_PATIENCE_S)
        if camera is None:
            self._statistics.bad_frame('no calibration')
            # The node says so again for as long as it lasts, with or without images.
            self._warn(self._calibration.state[1])
            return
        left, right = (
            decode_any_image(message, topic)
            for message, topic in zip((pair.left, pair.right), self._sources.topics(), strict=True)
        )
        self._check_sizes(left, right, camera)
        header = pair.left.header
        detection = self._detector_for(camera).detect(
            left, right, gravity=self._sources.gravity(header)
        )
        valid_share = np.count_nonzero(detection.disparity > 0) / detection.disparity.size
        refuse_swapped_images(detection, left, right, *self._sources.topics())
        self._outputs.publish(detection, header)
        self._statistics.detection(
            time.monotonic() - pair.arrival_s,
            valid_share=valid_share,
            obstacle_share=np.count_nonzero(detection.mask) / detection.mask.size,
            rows_off_px=detection.alignment.most_px(camera),
            lens_bend_px=detection.lenses.mean_bend_px(camera),
        )

    def _check_sizes(self, left: Any, right: Any, camera: StereoCamera) -> None:
        left_topic, right_topic = self._sources.topics()
        size, right_size = left.shape[1::-1], right.shape[1::-1]
        if size != right_size:
            msg = (
                f'{left_topic}: width x height is {size[0]} x {size[1]}, that of {right_topic} is '
                f'{right_size[0]} x {right_size[1]}: expected the same'
            )
            raise ImageError(msg)
        if size != (camera.width, camera.height):
            msg = (
                f'{left_topic}: width x height is {size[0]} x {size[1]}: expected '
                f'{camera.width} x {camera.height}, as camera_info says'
            )
            raise ImageError(msg)

    def _detector_for(self, camera: StereoCamera) -> Detector:
        settings = self._sources.settings()
        if (
            self._detector is None
            or self._detector[0] != camera
            or (self._detector[1] is not settings)
        ):
            mask = settings.rover_mask
            pixels = None if mask is None else mask.pixels(camera.height, camera.width)
            self._detector = camera, settings, Detector(camera, settings.config, pixels)
        return self._detector[2]
