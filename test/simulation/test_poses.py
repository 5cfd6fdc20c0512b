from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.simulation.description import DriveParameters
from rover_obstacle_detection.simulation.frames import right_eye
from rover_obstacle_detection.simulation.poses import CameraPose, drive, eye_pose, standing_pose
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


def test_on_level_ground_the_camera_is_as_the_rig_says():
    pose = standing_pose(plane(), STUDY, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(pose.position, [0, 0, 1], atol=1e-12)
    assert pose.pitch_deg == pytest.approx(46.0)
    assert pose.roll_deg == pytest.approx(0.0, abs=1e-9)
    # The optical axis goes ahead and down, the image's right is the world's -y.
    np.testing.assert_allclose(pose.rotation[:, 0], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(
        pose.rotation[:, 2],
        [math.cos(math.radians(46)), 0, -math.sin(math.radians(46))],
        atol=1e-12,
    )


def test_uphill_the_camera_looks_up_and_across_it_rolls():
    uphill = standing_pose(plane(along_x=math.tan(math.radians(10))), STUDY, 0.0, 0.0, 0.0)
    assert uphill.pitch_deg == pytest.approx(36.0, abs=0.01)
    # The left side higher: the rover leans to the right, clockwise as it sees itself.
    across = standing_pose(plane(along_y=math.tan(math.radians(10))), STUDY, 0.0, 0.0, 0.0)
    assert across.roll_deg > 5.0


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-3.1, 3.1))
def test_a_pose_is_a_rotation_and_tells_its_vertical(along_x, along_y, heading):
    pose = standing_pose(plane(along_x, along_y), STUDY, 1.0, -2.0, heading)
    np.testing.assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(matrix_of(*pose.quaternion), pose.rotation, atol=1e-9)
    said = Gravity.from_angles(pose.pitch_deg, pose.roll_deg).up
    np.testing.assert_allclose(said, pose.up, atol=1e-9)


def test_points_go_to_the_world_and_back():
    pose = standing_pose(plane(0.1, -0.2), STUDY, 3.0, 1.0, 0.7)
    points = np.random.default_rng(1).normal(size=(4, 5, 3))
    np.testing.assert_allclose(pose.to_camera(pose.to_world(points)), points, atol=1e-12)


def test_the_right_eye_stands_to_the_right():
    pose = standing_pose(plane(), STUDY, 0.0, 0.0, 0.0)
    right = eye_pose(pose, 0.06)
    np.testing.assert_allclose(right.position, [0, -0.06, 1], atol=1e-12)
    np.testing.assert_array_equal(right.rotation, pose.rotation)


def test_a_drive_goes_round_a_circle():
    poses = drive(plane(), STUDY, DriveParameters(frames=37, step_m=0.5, turn_deg=10.0))
    assert len(poses) == 37
    places = np.array([pose.ground_below for pose in poses])
    np.testing.assert_allclose(places[36], places[0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(np.diff(places, axis=0), axis=1), 0.5)
    assert isinstance(poses[0], CameraPose)
    assert poses[1].heading_rad == pytest.approx(math.radians(10.0))


def test_a_rectification_error_lifts_the_right_image():
    scene = scene_of('x', 1, ['rectification_off'], 'study', {'sensor': {'roll_error_deg': 0.0}})
    camera = scene.rig_used().camera()
    pose = standing_pose(plane(), STUDY, 0.0, 0.0, 0.0)
    moved, right = right_eye(scene, camera, pose)
    point = pose.to_world(np.array([0.1, 0.2, 2.0]))
    x, y, z = right.to_camera(point)
    assert moved.fy * y / z + moved.cy == pytest.approx(camera.fy * 0.1 + camera.cy - 0.5)
    assert moved.fx * x / z + moved.cx == pytest.approx(
        camera.fx * 0.05 + camera.cx - camera.fx * 0.06 / 2
    )
