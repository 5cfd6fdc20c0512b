"""The calibration that a user gives for a recording."""

from __future__ import annotations

import logging
from pathlib import Path

from rover_obstacle_detection.bags.reader import BadMessage, BagReader
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.calibration_files.numbers import Cameras, Size
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.errors import BagError, CameraError
from rover_obstacle_detection.messages.calibration import StereoCalibration
from rover_obstacle_detection.messages.image import image_size
from rover_obstacle_detection.messages.rectification import needs_rectification

_logger = logging.getLogger(__name__)


def requested_calibration(
    request: CalibrationRequest, bag: BagReader, topics: StereoTopics
) -> StereoCalibration | None:
    """Return the calibration that a user gives for a recording; None if nothing is given.

    Numbers that are no complete camera replace values of the recording's first camera_info. A
    complete camera replaces all of it, with a warning if it rectifies raw images.

    Raises
    ------
    CameraError
        If something is missing, cannot be read or forms no stereo camera.
    BagError
        If the recording cannot be read, or if the size of its images is needed and it has none.
    """

    def size() -> Size:
        width, height = _first_size(bag, topics.left_image)
        return width // (2 if topics.is_side_by_side else 1), height

    def recorded() -> tuple[Cameras, str]:
        try:
            return bag.camera_infos(topics), f'{topics.left_info} and {topics.right_info}'
        except BagError as error:
            raise CameraError(f'{bag.path}: {request.lack}; {error}') from None

    if not request.is_given:
        return None
    if not request.files and request.is_complete and not topics.is_rectified:
        _warn_of_replaced_rectification(request, bag, topics)
    return request.calibration(size, f'{bag.path} {topics.left_image}', recorded)


def _warn_of_replaced_rectification(
    request: CalibrationRequest, bag: BagReader, topics: StereoTopics
) -> None:
    try:
        cameras = bag.camera_infos(topics)
    except BagError:
        return
    # An uncalibrated camera has zeros.
    if any(needs_rectification(each) and each.k[0] > 0 and each.p[0] > 0 for each in cameras):
        _logger.warning(
            'a lens distortion or rotation is in %s and %s, which %s replaces: the images are '
            'taken as rectified; to rectify them, give only --baseline',
            topics.left_info,
            topics.right_info,
            request.numbers,
        )


def _first_size(bag: BagReader, topic: str) -> Size:
    first: Path | None = None
    for _, stamp_ns, message in bag.messages([topic]):
        first = first or bag.file_of(topic, stamp_ns)
        if not isinstance(message, BadMessage) and (size := image_size(message)):
            return size
    where = f': the first is {first}' if first else ''
    raise BagError(f'{bag.path}: {topic} has no image that can be decoded{where}')
