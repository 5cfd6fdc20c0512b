"""Stereo calibration from the two camera_info topics."""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.messages.raw_images import treatment
from rover_obstacle_detection.messages.rectification import StereoRectification

RECTIFIED = 'rectified'


class Calibrated(NamedTuple):
    """A stereo camera, and what makes its images fit it.

    Parameters
    ----------
    camera : StereoCamera
        Of the rectified images.
    rectify : StereoRectification or None
        For raw images that need it.
    treatment : str
        What is done with the images: `RECTIFIED`, or in words.
    """

    camera: StereoCamera
    rectify: StereoRectification | None = None
    treatment: str = RECTIFIED


class LiveCalibration:
    """Keeps the newest CameraInfo of both cameras and the stereo camera they form.

    Callbacks write it, the worker reads it. A repeated CameraInfo keeps the same `StereoCamera`
    object.

    Parameters
    ----------
    left_topic, right_topic : str
        For error messages.
    """

    _infos: list[Any]
    _contents: list[tuple[object, ...] | None]
    _confirmed: list[bool]
    _calibrated: Calibrated | None

    def __init__(self, left_topic: str, right_topic: str) -> None:
        self._topics = (left_topic, right_topic)
        self._changed = threading.Condition()
        self._raw_images = ''
        self.reset()

    def set_raw_images(self, names: str) -> bool:
        """Rectify the images of these two topics; an empty string: they are rectified.

        Returns
        -------
        bool
            Whether that is a change.
        """
        with self._changed:
            if names == self._raw_images:
                return False
            self._raw_images = names
            self._combine()
            return True

    @property
    def calibrated(self) -> Calibrated | None:
        """The camera, and how its images are rectified."""
        with self._changed:
            return self._calibrated

    @property
    def state(self) -> tuple[StereoCamera | None, str]:
        """The camera, or None and the reason why there is none."""
        with self._changed:
            return self._calibrated and self._calibrated.camera, self._problem

    def wait_for_camera(self, timeout_s: float) -> Calibrated | None:
        """Return the camera, after waiting for a CameraInfo that is still expected.

        If none arrives in time, the known camera is used and not questioned again.
        """
        with self._changed:
            self._changed.wait_for(lambda: all(self._confirmed), timeout_s)
            if self._calibrated is not None:
                self._confirmed = [True, True]
            return self._calibrated

    def expect_confirmation(self) -> None:
        """Expect a CameraInfo of both cameras, because the topics were not subscribed."""
        with self._changed:
            self._confirmed = [False, False]

    def confirm(self, side: int) -> None:
        """Note that the left (0) or right (1) camera repeated its CameraInfo."""
        with self._changed:
            self._confirmed[side] = True
            self._changed.notify_all()

    def update(self, side: int, info: Any) -> bool:
        """Take a ``sensor_msgs/CameraInfo`` of the left (0) or right (1) camera.

        Returns
        -------
        bool
            Whether it differs from the previous one.
        """
        content = _content(info)
        with self._changed:
            self._confirmed[side] = True
            self._changed.notify_all()
            if content == self._contents[side]:
                return False
            self._infos[side], self._contents[side] = info, content
            self._combine()
            return True

    def reset(self) -> None:
        """Forget everything received."""
        with self._changed:
            self._infos = [None, None]
            self._contents = [None, None]
            self._confirmed = [False, False]
            self._combine()

    def _combine(self) -> None:
        self._calibrated = None
        left, right = self._infos
        if left is None or right is None:
            self._problem = self._missing()
            return
        try:
            self._calibrated, self._problem = self._of(left, right), ''
        except CameraError as error:
            self._problem = str(error)

    def _of(self, left: Any, right: Any) -> Calibrated:
        source = ', '.join(self._topics)
        if not self._raw_images:
            # Rectified images need no more than P.
            try:
                return Calibrated(StereoCamera.from_camera_info(left, right))
            except CameraError as error:
                raise CameraError(f'{source}: {error}') from None
        calibration = StereoCalibration(
            CameraInfo.from_message(left), CameraInfo.from_message(right), source
        )
        try:
            rectification = StereoRectification(calibration)
        except CameraError as error:
            raise CameraError(
                f'{self._raw_images} are raw images and cannot be rectified: {error}; if they '
                'are rectified, set rectify to never'
            ) from None
        words = treatment(rectification, calibration, self._raw_images)
        needed = rectification if rectification.is_needed else None
        return Calibrated(calibration.camera, needed, words)

    def _missing(self) -> str:
        missing = [
            topic for topic, info in zip(self._topics, self._infos, strict=True) if info is None
        ]
        return f'no calibration: nothing received on {" and ".join(missing)} yet'


def _content(info: Any) -> tuple[object, ...]:
    # Without the header, which changes with every message. As bytes, because NaN != NaN.
    roi = info.roi
    return (
        info.width,
        info.height,
        info.distortion_model,
        *(np.asarray(each, np.float64).tobytes() for each in (info.d, info.k, info.r, info.p)),
        info.binning_x,
        info.binning_y,
        (roi.x_offset, roi.y_offset, roi.width, roi.height),
    )
