from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.simulation.description import DriveParameters
from rover_obstacle_detection.simulation.frames import right_camera
from rover_obstacle_detection.simulation.poses import drive, right_of, standing_pose
from rover_obstacle_detection.simulation.presets import scene_of
from rover_obstacle_detection.simulation.rigs import RIGS

STUDY = RIGS['study']


def plane(along_x=0.0, along_y=0.0):
    return lambda x, y: (along_x * x + along_y * y).astype(np.float32)


def matrix_of(x, y, z, w):
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_camera_pose_on_level_ground():
    pose = standing_pose(plane(), STUDY, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(pose.position, [0, 0, 1], atol=1e-12)
    assert pose.pitch_deg == pytest.approx(46.0)
    assert pose.roll_deg == pytest.approx(0.0, abs=1e-9)
    # The optical axis points ahead and down; right in the image is -y in the world.
    np.testing.assert_allclose(pose.rotation[:, 0], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(
        pose.rotation[:, 2],
        [math.cos(math.radians(46)), 0, -math.sin(math.radians(46))],
        atol=1e-12,
    )


def test_slopes_change_pitch_and_roll():
    uphill = standing_pose(plane(along_x=math.tan(math.radians(10))), STUDY, 0.0, 0.0, 0.0)
    assert uphill.pitch_deg == pytest.approx(36.0, abs=0.01)
    # The left side is higher, so the rover rolls to the right (clockwise).
    across = standing_pose(plane(along_y=math.tan(math.radians(10))), STUDY, 0.0, 0.0, 0.0)
    assert across.roll_deg > 5.0


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-3.1, 3.1))
def test_pose_rotation_quaternion_and_vertical_agree(along_x, along_y, heading):
    pose = standing_pose(plane(along_x, along_y), STUDY, 1.0, -2.0, heading)
    np.testing.assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(matrix_of(*pose.quaternion), pose.rotation, atol=1e-9)
    up = Gravity.from_angles(pose.pitch_deg, pose.roll_deg).up
    np.testing.assert_allclose(up, pose.up, atol=1e-9)


def test_world_and_camera_transforms_are_inverse():
    pose = standing_pose(plane(0.1, -0.2), STUDY, 3.0, 1.0, 0.7)
    points = np.random.default_rng(1).normal(size=(4, 5, 3))
    np.testing.assert_allclose(pose.to_camera(pose.to_world(points)), points, atol=1e-12)


def test_right_camera_pose():
    pose = standing_pose(plane(), STUDY, 0.0, 0.0, 0.0)
    right = right_of(pose, 0.06)
    np.testing.assert_allclose(right.position, [0, -0.06, 1], atol=1e-12)
    np.testing.assert_array_equal(right.rotation, pose.rotation)


def test_drive_with_constant_turn_closes_a_circle():
    poses = drive(plane(), STUDY, DriveParameters(frames=37, step_m=0.5, turn_deg=10.0))
    assert len(poses) == 37
    places = np.array([pose.ground_below for pose in poses])
    np.testing.assert_allclose(places[36], places[0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(np.diff(places, axis=0), axis=1), 0.5)
    assert poses[1].heading_rad == pytest.approx(math.radians(10.0))


def test_rectification_error_shifts_the_right_image_up():
    scene = scene_of('x', 1, ['rectification_off'], 'study', {'sensor': {'roll_error_deg': 0.0}})
    camera = scene.rig_used().camera()
    pose = standing_pose(plane(), STUDY, 0.0, 0.0, 0.0)
    shifted, right = right_camera(scene, camera, pose)
    point = pose.to_world(np.array([0.1, 0.2, 2.0]))
    x, y, z = right.to_camera(point)
    assert shifted.fy * y / z + shifted.cy == pytest.approx(camera.fy * 0.1 + camera.cy - 0.5)
    assert shifted.fx * x / z + shifted.cx == pytest.approx(
        camera.fx * 0.05 + camera.cx - camera.fx * 0.06 / 2
    )
