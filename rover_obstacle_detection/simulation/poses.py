"""Camera poses of a drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation.description import DriveParameters
from rover_obstacle_detection.simulation.rigs import Rig

Floats = NDArray[np.float32]
HeightFunction = Callable[[Floats, Floats], Floats]

_FOOTPRINT_M = 0.8
"""Side of the square under the wheels."""


@dataclass(frozen=True)
class CameraPose:
    """Pose of a camera in the world (x ahead at the start, y left, z up).

    Parameters
    ----------
    position : ndarray of float64, shape (3,)
    rotation : ndarray of float64, shape (3, 3)
        From the optical frame (x right, y down, z forward) to the world.
    heading_rad : float
        Heading of the rover, anticlockwise from the start.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    heading_rad: float

    @property
    def up(self) -> NDArray[np.float64]:
        """Upward unit vector in the optical frame."""
        return np.asarray(self.rotation[2], np.float64)

    @property
    def pitch_deg(self) -> float:
        """Angle of the optical axis below the horizon (deg)."""
        return math.degrees(math.asin(max(-1.0, min(1.0, -self.up[2]))))

    @property
    def roll_deg(self) -> float:
        """Clockwise roll about the optical axis (deg)."""
        return math.degrees(math.atan2(-self.up[0], -self.up[1]))

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """The rotation as x, y, z, w."""
        m = self.rotation
        (a, b, c), (xy, xz, yz) = m.diagonal(), (m + m.T)[[0, 0, 1], [1, 2, 2]]
        wx, wy, wz = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
        # Each row is a multiple of the quaternion. The one with the largest diagonal element
        # avoids dividing by a small number (Shepperd 1978).
        rows = np.array(
            [
                (1 + a - b - c, xy, xz, wx),
                (xy, 1 - a + b - c, yz, wy),
                (xz, yz, 1 - a - b + c, wz),
                (wx, wy, wz, 1 + a + b + c),
            ]
        )
        row = rows[np.argmax(rows.diagonal())]
        x, y, z, w = (row / np.linalg.norm(row)).tolist()
        return (x, y, z, w) if w >= 0 else (-x, -y, -z, -w)

    def to_world(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Transform points, shape (..., 3), from the optical frame to the world."""
        return np.asarray(points @ self.rotation.T + self.position, np.float64)

    def to_camera(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Transform points, shape (..., 3), from the world to the optical frame."""
        return np.asarray((points - self.position) @ self.rotation, np.float64)

    @property
    def ground_below(self) -> tuple[float, float]:
        """Position x, y of the camera."""
        return float(self.position[0]), float(self.position[1])


def standing_pose(
    height: HeightFunction, rig: Rig, x_m: float, y_m: float, heading_rad: float
) -> CameraPose:
    """Return the left camera pose of a rover that stands on a plane fitted to the ground.

    Parameters
    ----------
    height : callable
        Returns the height of the ground (m) at positions x, y.
    rig : Rig
    x_m, y_m : float
        Position of the left camera for a level rover.
    heading_rad : float
    """
    steps = np.linspace(-_FOOTPRINT_M / 2, _FOOTPRINT_M / 2, 9)
    dx, dy = (grid.ravel() for grid in np.meshgrid(steps, steps))
    z = height((x_m + dx).astype(np.float32), (y_m + dy).astype(np.float32))
    design = np.column_stack([dx, dy, np.ones_like(dx)])
    (slope_x, slope_y, ground_m), *_ = np.linalg.lstsq(design, z.astype(np.float64), rcond=None)
    up = np.array([-slope_x, -slope_y, 1.0])
    up /= np.linalg.norm(up)
    level_ahead = np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])
    ahead = level_ahead - up * (up @ level_ahead)
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, up)
    pitch = math.radians(rig.pitch_deg)
    forward = ahead * math.cos(pitch) - up * math.sin(pitch)
    down = np.cross(forward, right)
    position = np.array([x_m, y_m, ground_m]) + rig.camera_height_m * up
    return CameraPose(position, np.column_stack([right, down, forward]), heading_rad)


def drive(height: HeightFunction, rig: Rig, parameters: DriveParameters) -> list[CameraPose]:
    """Return the left camera poses of an arc that starts at the origin along x."""
    x, y, heading = 0.0, 0.0, 0.0
    poses = []
    for _ in range(parameters.frames):
        poses.append(standing_pose(height, rig, x, y, heading))
        heading += math.radians(parameters.turn_deg) / 2
        x += parameters.step_m * math.cos(heading)
        y += parameters.step_m * math.sin(heading)
        heading += math.radians(parameters.turn_deg) / 2
    return poses


def right_of(pose: CameraPose, right_m: float, roll_deg: float = 0.0) -> CameraPose:
    """Return a pose shifted to the right and rolled about its optical axis."""
    c, s = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    roll = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    position = pose.position + right_m * pose.rotation[:, 0]
    return CameraPose(position, pose.rotation @ roll, pose.heading_rad)
