"""Stereo calibration from the two camera_info topics."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import CameraError


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
    _camera: StereoCamera | None

    def __init__(self, left_topic: str, right_topic: str) -> None:
        self._topics = (left_topic, right_topic)
        self._changed = threading.Condition()
        self.reset()

    @property
    def state(self) -> tuple[StereoCamera | None, str]:
        """The camera, or None and the reason why there is none."""
        with self._changed:
            return self._camera, self._problem

    def wait_for_camera(self, timeout_s: float) -> StereoCamera | None:
        """Return the camera, after waiting for a CameraInfo that is still expected.

        If none arrives in time, the known camera is used and not questioned again.
        """
        with self._changed:
            self._changed.wait_for(lambda: all(self._confirmed), timeout_s)
            if self._camera is not None:
                self._confirmed = [True, True]
            return self._camera

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
            left, right = self._infos
            if left is None or right is None:
                self._problem = self._missing()
                return True
            try:
                self._camera, self._problem = StereoCamera.from_camera_info(left, right), ''
            except CameraError as error:
                self._camera = None
                self._problem = f'{self._topics[0]}, {self._topics[1]}: {error}'
            return True

    def reset(self) -> None:
        """Forget everything received."""
        with self._changed:
            self._infos = [None, None]
            self._contents = [None, None]
            self._confirmed = [False, False]
            self._camera, self._problem = None, self._missing()

    def _missing(self) -> str:
        missing = [
            topic for topic, info in zip(self._topics, self._infos, strict=True) if info is None
        ]
        return f'no calibration: nothing received on {" and ".join(missing)} yet'


def _content(info: Any) -> tuple[object, ...]:
    # Without the header, which changes with every message. P as bytes, because NaN != NaN.
    roi = info.roi
    return (
        info.width,
        info.height,
        np.asarray(info.p, np.float64).tobytes(),
        info.binning_x,
        info.binning_y,
        (roi.x_offset, roi.y_offset, roi.width, roi.height),
    )
