"""The stereo calibration at each moment of a recording."""

from __future__ import annotations

import logging
from collections.abc import Set as AbstractSet
from typing import Any

from numpy.typing import NDArray

from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.raw_images import treatment
from rover_obstacle_detection.messages.rectification import StereoRectification

_logger = logging.getLogger(__name__)


class CalibrationWatch:
    """Follows calibration changes and rectifies raw images.

    A change takes effect once both cameras have sent theirs; after an invalid one there is no
    camera until the next valid one. Images are rectified if the names of their topics do not say
    that they are, and the calibration has a distortion or a rotation.

    Parameters
    ----------
    calibration : StereoCalibration
        The initial calibration.
    topics : StereoTopics
    info_topics : set of str
        Topics to follow; empty if the calibration is fixed.
    tolerance_ns : int
        Largest stamp difference of a left and a right camera_info that belong together.

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
        """The files or topics that the calibration comes from."""
        self._problem = ''
        self._topics = topics
        self._tolerance_ns = tolerance_ns
        self._left = (0, calibration.left)
        self._right = (0, calibration.right)
        self._use(calibration)

    @property
    def camera(self) -> StereoCamera:
        """The current camera.

        Raises
        ------
        CameraError
            If the latest calibration is not valid.
        """
        if self._problem:
            raise CameraError(self._problem)
        return self._calibration.camera

    def rectify(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Rectify a pair of raw images; return rectified ones unchanged."""
        return self._rectification(left, right) if self._rectification else (left, right)

    def take(self, topic: str, message: Any) -> None:
        """Process a ``sensor_msgs/CameraInfo``.

        Raises
        ------
        CameraError
            If it does not form a stereo camera with the other side's. There is no camera until
            a valid calibration arrives.
        """
        newest = stamp_ns(message.header), CameraInfo.from_message(message)
        if topic == self._topics.left_info:
            self._left = newest
        else:
            self._right = newest
        (left_ns, left), (right_ns, right) = self._left, self._right
        is_new = left != self._calibration.left or right != self._calibration.right
        if not (is_new or self._problem) or abs(left_ns - right_ns) > self._tolerance_ns:
            return
        try:
            self._use(StereoCalibration(left, right, self.source))
        except CameraError as error:
            self._problem = str(error)
            raise

    def _use(self, calibration: StereoCalibration) -> None:
        rectification = None
        if not self._topics.is_rectified:
            rectification = StereoRectification(calibration)
            # Who gives a calibration without distortion says that the images have none.
            if rectification.is_needed or self.info_topics:
                images = f'{self._topics.left_image} and {self._topics.right_image}'
                _logger.warning('%s', treatment(rectification, calibration, images))
        self._rectification = rectification
        self._calibration = calibration
        self._problem = ''
