"""Encode the rectified left camera as ``sensor_msgs/CameraInfo``."""

from __future__ import annotations

from typing import Any

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.messages.factory import MessageFactory


def encode_camera_info(camera: StereoCamera, header: Any, factory: MessageFactory) -> Any:
    """Make the ``sensor_msgs/CameraInfo`` of a detection's images.

    They are rectified, cropped and binned, so it has no distortion, rotation, binning or region.

    Parameters
    ----------
    camera : StereoCamera
    header : std_msgs/Header
    factory : MessageFactory
    """
    k = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    return factory.make(
        'sensor_msgs/msg/CameraInfo',
        header=header,
        height=camera.height,
        width=camera.width,
        distortion_model='plumb_bob',
        d=np.zeros(5),
        k=k.reshape(-1),
        r=np.identity(3).reshape(-1),
        p=np.column_stack((k, np.zeros(3))).reshape(-1),
    )
