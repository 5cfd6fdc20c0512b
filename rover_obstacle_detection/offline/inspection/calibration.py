"""The calibration of a recorded camera, or what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rover_obstacle_detection.bags.reader import BagReader
from rover_obstacle_detection.bags.requested_calibration import requested_calibration
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import (
    BagError,
    CameraError,
    ObstacleDetectionError,
    failure_text,
)
from rover_obstacle_detection.messages.calibration import StereoCalibration
from rover_obstacle_detection.messages.rectification import StereoRectification
from rover_obstacle_detection.offline.inspection.streams import InfoStream


@dataclass(frozen=True)
class Calibration:
    """The calibration of a camera.

    Parameters
    ----------
    stereo : StereoCalibration or None
        None if it is missing or invalid.
    rectification : StereoRectification or None
        For raw images.
    problem : str
        Why there is none.
    left, right : InfoStream or None
        The messages of the info topics.
    """

    stereo: StereoCalibration | None
    rectification: StereoRectification | None
    problem: str
    left: InfoStream | None
    right: InfoStream | None

    @property
    def camera(self) -> StereoCamera | None:
        """The stereo camera."""
        return self.stereo.camera if self.stereo else None


def find_calibration(
    bag: BagReader,
    topics: StereoTopics,
    infos: Mapping[str, InfoStream],
    request: CalibrationRequest,
) -> Calibration:
    """Use the given calibration, or the first camera_info of each side."""
    given = requested_calibration(request, bag, topics)
    left, right = (infos.get(name or '') for name in (topics.left_info, topics.right_info))
    try:
        stereo = given or bag.calibration(topics)
        rectification = None if topics.is_rectified else StereoRectification(stereo)
    except (BagError, CameraError) as error:
        return Calibration(None, None, without_path(error, bag), left, right)
    return Calibration(stereo, rectification, '', left, right)


def without_path(error: ObstacleDetectionError, bag: BagReader) -> str:
    """Return an error without the recording's path in front."""
    return failure_text(error).removeprefix(f'{bag.path}: ')
