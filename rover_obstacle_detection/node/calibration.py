"""The calibration that the two camera_info topics give, and what is wrong with it."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import CameraError


class LiveCalibration:
    """Keeps the newest CameraInfo of both eyes and the camera that they make.

    Callbacks write it, the worker reads it. The same calibration again, as drivers send it with
    every image, changes nothing: `camera` stays the same object.

    Parameters
    ----------
    left_topic, right_topic : str
        For the texts.
    """

    def __init__(self, left_topic: str, right_topic: str) -> None:
        self._topics = (left_topic, right_topic)
        self._changed = threading.Condition()
        self._infos: list[Any] = [None, None]
        self._contents: list[tuple[object, ...] | None] = [None, None]
        self._confirmed = [False, False]
        self._camera: StereoCamera | None = None
        self._problem = self._missing()

    @property
    def state(self) -> tuple[StereoCamera | None, str]:
        """The camera, or None and the line that says why there is none."""
        with self._changed:
            return self._camera, self._problem

    def wait_for_camera(self, timeout_s: float) -> StereoCamera | None:
        """Give the camera; wait a little where an eye has sent nothing since the start or `doubt`.

        What was known before a doubt is taken for right if nothing comes to confirm it.
        """
        with self._changed:
            self._changed.wait_for(lambda: all(self._confirmed), timeout_s)
            if self._camera is not None:
                self._confirmed = [True, True]
            return self._camera

    def doubt(self) -> None:
        """Expect another CameraInfo of both eyes: it was not listened to for a while."""
        with self._changed:
            self._confirmed = [False, False]

    def confirm(self, side: int) -> None:
        """Note that an eye has sent the same CameraInfo again."""
        with self._changed:
            self._confirmed[side] = True
            self._changed.notify_all()

    def take(self, side: int, info: Any) -> bool:
        """Take a ``sensor_msgs/CameraInfo`` of the left (0) or right (1) eye.

        Returns
        -------
        bool
            Whether it differs from the one before.
        """
        contents = _contents(info)
        with self._changed:
            self._confirmed[side] = True
            self._changed.notify_all()
            if contents == self._contents[side]:
                return False
            self._infos[side], self._contents[side] = info, contents
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

    def forget(self) -> None:
        """Start afresh, as before the first CameraInfo."""
        with self._changed:
            self._infos, self._contents = [None, None], [None, None]
            self._confirmed = [False, False]
            self._camera, self._problem = None, self._missing()

    def _missing(self) -> str:
        missing = [
            topic for topic, info in zip(self._topics, self._infos, strict=True) if info is None
        ]
        return f'no calibration: nothing came on {" and ".join(missing)} yet'


def _contents(info: Any) -> tuple[object, ...]:
    # Every driver stamps each CameraInfo anew; only what a camera is made of counts. P as bytes,
    # because a NaN would differ from itself.
    roi = info.roi
    return (
        info.width,
        info.height,
        np.asarray(info.p, np.float64).tobytes(),
        info.binning_x,
        info.binning_y,
        (roi.x_offset, roi.y_offset, roi.width, roi.height),
    )
