"""The gravity direction from IMU messages."""

from __future__ import annotations

import math
import threading
from collections import deque
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.messages.header import stamp_ns

# A pitching rover turns by a few degrees in this time.
MAX_AGE_NS = 200_000_000
# Time constant that averages out the shocks of wheels on stones.
SMOOTHING_NS = 500_000_000
# A stamp this far back means that a recording restarted.
RESTART_NS = 1_000_000_000
# Messages kept: 5 s at 200 Hz.
KEPT = 1000
# Largest deviation of a unit quaternion's length from 1.
LENGTH_TOLERANCE = 0.01
# A shorter acceleration (m/s2) has no direction.
MIN_LENGTH = 1e-6


class ImuGravity:
    """Keeps the up direction of the latest ``sensor_msgs/Imu`` messages, by stamp.

    Up is the world's z axis given by the orientation (REP 145). Without an orientation it is the
    acceleration, smoothed over half a second: at rest, it points against gravity on any planet.

    Parameters
    ----------
    angles_deg : tuple of float
        Roll, pitch and yaw of the IMU frame in the left optical frame, as URDF's rpy (deg).
    """

    def __init__(self, angles_deg: tuple[float, float, float]) -> None:
        self._rotation = rotation_from_rpy(angles_deg)
        self._lock = threading.Lock()
        self._stamps_ns: deque[int] = deque(maxlen=KEPT)
        self._ups: deque[NDArray[np.float64]] = deque(maxlen=KEPT)
        self._smoothed: NDArray[np.float64] | None = None

    def add(self, message: Any) -> str | None:
        """Add a message; return what is wrong with it, or None."""
        now_ns = stamp_ns(message.header)
        up, acceleration = _orientation(message), _acceleration(message)
        if up is None and acceleration is None:
            return 'neither a unit orientation nor a linear_acceleration: expected one of them'
        with self._lock:
            elapsed_ns = now_ns - self._stamps_ns[-1] if self._stamps_ns else 0
            if elapsed_ns < -RESTART_NS:
                self._stamps_ns.clear()
                self._ups.clear()
                self._smoothed = None
            if up is None:
                assert acceleration is not None
                up = self._smooth(acceleration, max(elapsed_ns, 0))
            length = float(np.linalg.norm(up))
            if length < MIN_LENGTH:
                return 'linear_acceleration is zero: expected the reaction to gravity'
            self._stamps_ns.append(now_ns)
            self._ups.append(self._rotation @ (up / length))
        return None

    def at(self, wanted_ns: int, height_m: float | None) -> Gravity | None:
        """Return gravity from the message nearest to a stamp; None if none is near."""
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
    """Return the rotation from child to parent frame for URDF's roll, pitch and yaw (deg).

    Returns
    -------
    ndarray of float64, shape (3, 3)
    """
    about_x, about_y, about_z = (
        cv2.Rodrigues(math.radians(angle) * axis)[0]
        for angle, axis in zip(angles_deg, np.identity(3), strict=True)
    )
    rotation: NDArray[np.float64] = about_z @ about_y @ about_x
    return rotation


def up_from_quaternion(x: float, y: float, z: float, w: float) -> NDArray[np.float64]:
    """Return the world's z axis in the body frame; the unit quaternion turns body to world."""
    return np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])


def _orientation(message: Any) -> NDArray[np.float64] | None:
    # sensor_msgs/Imu marks a field that is not measured with -1 as its first covariance.
    turned = message.orientation
    length = math.sqrt(turned.x**2 + turned.y**2 + turned.z**2 + turned.w**2)
    if message.orientation_covariance[0] == -1 or not abs(length - 1.0) < LENGTH_TOLERANCE:
        return None
    return up_from_quaternion(turned.x, turned.y, turned.z, turned.w)


def _acceleration(message: Any) -> NDArray[np.float64] | None:
    measured = message.linear_acceleration
    vector = np.array([measured.x, measured.y, measured.z])
    if message.linear_acceleration_covariance[0] == -1 or not np.isfinite(vector).all():
        return None
    return vector
