from __future__ import annotations

import struct

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.result.grid import obstacle_grid
from rover_obstacle_detection.messages.grid import encode_grid
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory

FACTORY = RosbagsFactory()
HEADER = make_header(5_000_000_006, 'left', FACTORY)
UP = (0.0, -1.0, 0.0)
NONE = np.zeros((0, 3), np.float32)


def grid_of(up=UP, obstacles=NONE, free=NONE):
    return obstacle_grid(obstacles, free, GroundPlane(up, 1.5, up), 0.5, 2.0)


def rotated(quaternion, vector):
    """Rotate a vector as tf2 does."""
    axis = np.array([quaternion.x, quaternion.y, quaternion.z])
    cross = 2 * np.cross(axis, vector)
    return vector + quaternion.w * cross + np.cross(axis, cross)


def test_bytes_of_a_level_camera():
    obstacle = np.array([[0.9, 1.0, 0.1]], np.float32)
    free = np.array([[-0.9, 1.5, 1.9]], np.float32)
    message = encode_grid(grid_of(obstacles=obstacle, free=free), HEADER, FACTORY)
    raw = bytes(FACTORY.typestore.serialize_cdr(message, 'nav_msgs/msg/OccupancyGrid'))
    expected = b'\x00\x01\x00\x00' + struct.pack('<iI', 5, 6)
    expected += struct.pack('<I', 5) + b'left\0' + bytes(3)
    # map_load_time, resolution, width, height.
    expected += struct.pack('<iI', 5, 6) + struct.pack('<fII', 0.5, 4, 4)
    pose = struct.unpack('<7d', raw[len(expected) : len(expected) + 56])
    assert raw.startswith(expected)
    # The corner is 1 m to the right (x) and 1.5 m below (y).
    assert pose == pytest.approx((1.0, 1.5, 0.0, 0.5, -0.5, 0.5, 0.5))
    data = np.full(16, -1, np.int8)
    # Nearest to the right, first; farthest to the left, last.
    data[0], data[15] = 100, 0
    assert raw[len(expected) + 56 :] == struct.pack('<I', 16) + data.tobytes()


@pytest.mark.parametrize('pitch_deg', [-5.0, 0.0, 46.0, 90.0])
@pytest.mark.parametrize('roll_deg', [-20.0, 0.0, 10.0])
def test_pose_maps_the_centres_of_cells_onto_the_points(pitch_deg, roll_deg):
    up = np.asarray(Gravity.from_angles(pitch_deg, roll_deg).up)
    axes = grid_of(tuple(up)).axes
    # On the ground, 1.25 m ahead and 0.75 m to the left; and 0.25 m ahead, 0.25 m to the right.
    place = {
        along: -1.5 * up + along * axes[0] + left * axes[1]
        for along, left in ((1.25, 0.75), (0.25, -0.25))
    }
    obstacle, free = (np.array([each], np.float32) for each in place.values())
    message = encode_grid(grid_of(tuple(up), obstacle, free), HEADER, FACTORY)
    info = message.info
    origin = np.array([getattr(info.origin.position, axis) for axis in 'xyz'])
    orientation = info.origin.orientation
    values = [orientation.x, orientation.y, orientation.z, orientation.w]
    assert np.linalg.norm(values) == pytest.approx(1)
    for value, expected in zip((100, 0), place.values(), strict=True):
        (index,) = np.flatnonzero(message.data == value)
        row, column = divmod(int(index), info.width)
        cell = np.array([column + 0.5, row + 0.5, 0.0]) * info.resolution
        np.testing.assert_allclose(origin + rotated(orientation, cell), expected, atol=1e-6)
