"""The calibration at each moment of a recording, in which it may change."""

from __future__ import annotations

import logging
from collections.abc import Set as AbstractSet
from typing import Any

from numpy.typing import NDArray

from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.rectification import StereoRectification

_logger = logging.getLogger(__name__)


class FixedCamera:
    """A camera that was given, whose images are rectified.

    Parameters
    ----------
    camera : StereoCamera
    """

    source = 'the given one'
    info_topics: AbstractSet[str] = frozenset()

    def __init__(self, camera: StereoCamera) -> None:
        self.camera = camera

    def rectify(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Pass a pair on."""
        return left, right

    def take(self, topic: str, message: Any) -> None:
        """Take no notice of a ``sensor_msgs/CameraInfo``."""


class CalibrationWatch:
    """Takes up each change of calibration once both eyes have it, and rectifies raw images.

    Images whose topics are not named as rectified ones are rectified where the calibration tells
    of a distortion or a rotation.

    Parameters
    ----------
    calibration : StereoCalibration
        The one to begin with.
    topics : StereoTopics
    info_topics : set of str
        Topics to follow; none if the calibration was given.
    tolerance_ns : int
        Largest difference of the stamps of two camera_info that belong together.

    Raises
    ------
    CameraError
        If raw images cannot be rectified with this calibration.
    """

    def __init__(
        self,
        calibration: StereoCalibration,
        topics: StereoTopics,
        info_topics: AbstractSet[str],
        tolerance_ns: int,
    ) -> None:
        self.info_topics = info_topics
        self.source = calibration.source
        """Where the calibration comes from: files or topics."""
        self._topics = topics
        self._tolerance_ns = tolerance_ns
        self._left = (0, calibration.left)
        self._right = (0, calibration.right)
        self._use(calibration)

    @property
    def camera(self) -> StereoCamera:
        """The camera now."""
        return self._calibration.camera

    def rectify(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Make a pair rectified; see `StereoRectification`."""
        return self._rectification(left, right) if self._rectification else (left, right)

    def take(self, topic: str, message: Any) -> None:
        """Take a ``sensor_msgs/CameraInfo``.

        Raises
        ------
        CameraError
            If it makes no stereo camera with the other eye's; the former calibration stays.
        """
        newest = stamp_ns(message.header), CameraInfo.from_message(message)
        if topic == self._topics.left_info:
            self._left = newest
        else:
            self._right = newest
        (left_ns, left), (right_ns, right) = self._left, self._right
        is_new = left != self._calibration.left or right != self._calibration.right
        if is_new and abs(left_ns - right_ns) <= self._tolerance_ns:
            self._use(StereoCalibration(left, right, self.source))

    def _use(self, calibration: StereoCalibration) -> None:
        rectification = None
        if not self._topics.is_rectified:
            rectification = StereoRectification(calibration)
            if rectification.is_needed:
                _logger.warning(
                    '%s and %s are raw by their names: rectified with K, D, R and P of %s',
                    self._topics.left_image,
                    self._topics.right_image,
                    calibration.source,
                )
        self._rectification = rectification
        self._calibration = calibration
