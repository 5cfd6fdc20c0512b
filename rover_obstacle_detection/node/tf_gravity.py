"""The gravity direction from TF: the z axis of the rover's base frame."""

from __future__ import annotations

import importlib
from typing import Any

from rclpy.duration import Duration

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.node.imu_gravity import up_from_quaternion

# The transform of a pan-tilt head can arrive a little after the image.
PATIENCE_S = 0.1


def import_tf2_ros() -> Any:
    """Import tf2_ros, which is not on PyPI.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        return importlib.import_module('tf2_ros')
    except ImportError as error:
        msg = (
            'gravity_source tf needs tf2_ros, which is not on PyPI: install ROS 2 with '
            'ros-jazzy-tf2-ros-py, or set gravity_source to estimate, parameters or imu'
        )
        raise MissingExtraError(msg) from error


class TfGravity:
    """Looks up the gravity direction in TF.

    Parameters
    ----------
    node : rclpy node
        Its executor runs the listener.
    base_frame : str
        Frame whose z axis points up.
    """

    def __init__(self, node: Any, base_frame: str) -> None:
        self._tf2_ros = import_tf2_ros()
        self._base_frame = base_frame
        self._buffer = self._tf2_ros.Buffer()
        self._patience = Duration(seconds=PATIENCE_S)
        self._listener = self._tf2_ros.TransformListener(self._buffer, node)

    def at(self, stamp: Any, frame_id: str, height_m: float | None) -> Gravity | str:
        """Look up gravity at a stamp.

        Parameters
        ----------
        stamp : rclpy.time.Time
        frame_id : str
            The left optical frame.
        height_m : float or None
            Camera height to put into the result (m).

        Returns
        -------
        Gravity or str
            Gravity, or the reason why there is none.
        """
        try:
            transform = self._buffer.lookup_transform(
                self._base_frame, frame_id, stamp, timeout=self._patience
            )
        except self._tf2_ros.TransformException as error:
            return f'no transform from {frame_id!r} to {self._base_frame!r}: {error}'
        turned = transform.transform.rotation
        x, y, z = up_from_quaternion(turned.x, turned.y, turned.z, turned.w)
        return Gravity(up=(float(x), float(y), float(z)), height_m=height_m)

    def close(self) -> None:
        """Unsubscribe from TF."""
        self._listener.unregister()
