"""Which way is up, from the messages of an IMU."""

from __future__ import annotations

import math
import threading
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.messages.header import stamp_ns

# A pitching rover turns a few degrees in this time.
MAX_AGE_NS = 200_000_000
# Accelerations of wheels on stones average out over this time.
SMOOTHING_NS = 500_000_000
RESTART_NS = 1_000_000_000
KEPT = 1000


class ImuGravity:
    """Keeps the vertical of the latest ``sensor_msgs/Imu`` messages, by stamp.

    The orientation gives it where the IMU has one (its z axis is up, REP-145); otherwise the
    acceleration, smoothed over half a second: at rest it points against gravity on any planet.

    Parameters
    ----------
    angles_deg : tuple of float
        Roll, pitch and yaw of the IMU frame in the left optical frame, as URDF's rpy.
    """

    def __init__(self, angles_deg: tuple[float, float, float]) -> None:
        self._rotation = rotation_from_rpy(angles_deg)
        self._lock = threading.Lock()
        self._stamps_ns: deque[int] = deque(maxlen=KEPT)
        self._ups: deque[NDArray[np.float64]] = deque(maxlen=KEPT)
        self._smoothed: NDArray[np.float64] | None = None

    def take(self, message: Any) -> str | None:
        """Take a message; return a line that says what is wrong with it, or None."""
        now_ns = stamp_ns(message.header)
        orientation, acceleration = _orientation(message), _acceleration(message)
        if orientation is None and acceleration is None:
            return 'neither a unit orientation nor a linear_acceleration: expected one of them'
        with self._lock:
            elapsed_ns = now_ns - self._stamps_ns[-1] if self._stamps_ns else 0
            if elapsed_ns < -RESTART_NS:
                self._stamps_ns.clear()
                self._ups.clear()
                self._smoothed = None
            if orientation is not None:
                up = orientation
            else:
                assert acceleration is not None
                up = self._smooth(acceleration, max(elapsed_ns, 0))
            length = float(np.linalg.norm(up))
            if length < 1e-6:
                return 'linear_acceleration is zero: expected the reaction to gravity'
            self._stamps_ns.append(now_ns)
            self._ups.append(self._rotation @ (up / length))
        return None

    def at(self, wanted_ns: int, height_m: float | None) -> Gravity | None:
        """Vertical at a stamp: of the message nearest to it; None if none is near."""
        with self._lock:
            if not self._stamps_ns:
                return None
            gaps_ns = np.abs(np.asarray(self._stamps_ns, np.int64) - wanted_ns)
            nearest = int(gaps_ns.argmin())
            if gaps_ns[nearest] > MAX_AGE_NS:
                return None
            x, y, z = (float(value) for value in self._ups[nearest])
        return Gravity(up=(x, y, z), height_m=height_m)

    def _smooth(self, acceleration: NDArray[np.float64], elapsed_ns: int) -> NDArray[np.float64]:
        if self._smoothed is None:
            self._smoothed = acceleration
        else:
            weight = 1.0 - math.exp(-elapsed_ns / SMOOTHING_NS)
            self._smoothed = self._smoothed + weight * (acceleration - self._smoothed)
        return self._smoothed


def rotation_from_rpy(angles_deg: tuple[float, float, float]) -> NDArray[np.float64]:
    """Rotation of fixed-axis roll, pitch, yaw (URDF), shape (3, 3): child to parent frame."""
    roll, pitch, yaw = (math.radians(angle) for angle in angles_deg)
    about_x = np.array(
        [
            [1, 0, 0],
            [0, math.cos(roll), -math.sin(roll)],
            [0, math.sin(roll), math.cos(roll)],
        ]
    )
    about_y = np.array(
        [
            [math.cos(pitch), 0, math.sin(pitch)],
            [0, 1, 0],
            [-math.sin(pitch), 0, math.cos(pitch)],
        ]
    )
    about_z = np.array(
        [
            [math.cos(yaw), -math.sin(yaw), 0],
            [math.sin(yaw), math.cos(yaw), 0],
            [0, 0, 1],
        ]
    )
    rotation: NDArray[np.float64] = about_z @ about_y @ about_x
    return rotation


def up_from_quaternion(x: float, y: float, z: float, w: float) -> NDArray[np.float64]:
    """World's z axis in the frame that a unit quaternion turns into the world."""
    return np.array(
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ]
    )


def _orientation(message: Any) -> NDArray[np.float64] | None:
    # sensor_msgs/Imu: a covariance that begins with -1 says that the field is not measured.
    turned = message.orientation
    length = math.sqrt(turned.x**2 + turned.y**2 + turned.z**2 + turned.w**2)
    if message.orientation_covariance[0] == -1 or not abs(length - 1.0) < 0.01:
        return None
    return up_from_quaternion(turned.x, turned.y, turned.z, turned.w)


def _acceleration(message: Any) -> NDArray[np.float64] | None:
    measured = message.linear_acceleration
    vector = np.array([measured.x, measured.y, measured.z])
    if message.linear_acceleration_covariance[0] == -1 or not np.isfinite(vector).all():
        return None
    return vector
