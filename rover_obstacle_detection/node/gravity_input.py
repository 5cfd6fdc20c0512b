"""The vertical for each pair, from the topic or the transform that the parameters name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.qos import qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.time import Time

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.node.imu_gravity import MAX_AGE_NS, ImuGravity
from rover_obstacle_detection.node.rclpy_factory import message_type
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.tf_gravity import TfGravity


class GravityInput:
    """Gives the worker the vertical where ``gravity_source`` is ``imu`` or ``tf``.

    Where the source gives none for a pair, the detector estimates it from the ground in view,
    and `problem` says so.

    Parameters
    ----------
    node : rclpy node
    settings : Settings
    warn : callable
        Takes a line that says what is wrong.
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
        """Take up other settings: listen to what they name, to nothing else."""
        self.destroy()
        self._height_m = settings.config.camera_height or None
        if settings.config.gravity_source == 'imu':
            self._imu = ImuGravity(settings.imu_angles_deg)
            self._topic = self._node.resolve_topic_name('imu')
            self._subscription = self._node.create_subscription(
                message_type('sensor_msgs/msg/Imu'),
                'imu',
                self._take_imu,
                qos_profile_sensor_data,
                qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            )
        elif settings.config.gravity_source == 'tf':
            self._tf = TfGravity(self._node, settings.base_frame)

    def destroy(self) -> None:
        """Listen to nothing."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        if self._tf is not None:
            self._tf.close()
        self._subscription, self._imu, self._tf = None, None, None
        self.problem = ''

    def at(self, header: Any) -> Gravity | None:
        """Vertical at the stamp and in the frame of a left image; None: to be estimated."""
        imu, tf = self._imu, self._tf
        found: Gravity | str | None = None
        if imu is not None:
            found = imu.at(stamp_ns(header), self._height_m)
            if found is None:
                found = (
                    f'{self._topic}: no usable message within {MAX_AGE_NS / 1e6:.0f} ms of the '
                    'image'
                )
        elif tf is not None:
            found = tf.at(Time.from_msg(header.stamp), header.frame_id, self._height_m)
        if isinstance(found, str):
            self.problem = f'{found}; gravity is estimated from the ground in view'
            self._warn(self.problem)
            return None
        self.problem = ''
        return found

    def _take_imu(self, message: Any) -> None:
        if self._imu is not None and (problem := self._imu.take(message)):
            self._warn(f'{self._topic}: {problem}')
