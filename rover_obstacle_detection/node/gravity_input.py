"""The gravity direction for each pair, from an IMU topic or TF."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.time import Time

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.node.imu_gravity import MAX_AGE_NS, ImuGravity
from rover_obstacle_detection.node.inputs import subscribe
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.tf_gravity import TfGravity


class GravityInput:
    """Provides gravity to the worker if ``gravity_source`` is ``imu`` or ``tf``.

    If the source has nothing for a pair, the detector estimates gravity from the visible ground
    and `problem` says why.

    Parameters
    ----------
    node : rclpy node
    settings : Settings
    warn : callable
        Logs a warning.
    """

    def __init__(self, node: Any, settings: Settings, warn: Callable[[str], object]) -> None:
        self._node = node
        self._warn = warn
        self._subscription: Any = None
        self._imu: ImuGravity | None = None
        self._tf: TfGravity | None = None
        self.problem = ''
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Apply new settings: subscribe to the selected source only."""
        self.destroy()
        self._height_m = settings.config.camera_height or None
        if settings.config.gravity_source == 'imu':
            self._imu = ImuGravity(settings.imu_angles_deg)
            self._topic = self._node.resolve_topic_name('imu')
            self._subscription = subscribe(
                self._node, 'sensor_msgs/msg/Imu', 'imu', self._take_imu
            )
        elif settings.config.gravity_source == 'tf':
            self._tf = TfGravity(self._node, settings.base_frame)

    def destroy(self) -> None:
        """Drop all subscriptions."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        if self._tf is not None:
            self._tf.close()
        self._subscription, self._imu, self._tf = None, None, None
        self.problem = ''

    def at(self, header: Any) -> Gravity | None:
        """Return gravity at the stamp and in the frame of a left image.

        Parameters
        ----------
        header : std_msgs/Header

        Returns
        -------
        Gravity or None
            None if the detector has to estimate it.
        """
        imu, tf = self._imu, self._tf
        found: Gravity | str | None = None
        if imu is not None:
            found = imu.at(stamp_ns(header), self._height_m) or (
                f'{self._topic}: no usable message within {MAX_AGE_NS / 1e6:.0f} ms of the image'
            )
        elif tf is not None:
            found = tf.at(Time.from_msg(header.stamp), header.frame_id, self._height_m)
        if isinstance(found, str):
            self.problem = f'{found}; gravity is estimated from the visible ground'
            self._warn(self.problem)
            return None
        self.problem = ''
        return found

    def _take_imu(self, message: Any) -> None:
        if self._imu is not None and (problem := self._imu.add(message)):
            self._warn(f'{self._topic}: {problem}')
