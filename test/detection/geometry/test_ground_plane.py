from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.plane_fit import estimate_ground, fit_ground_plane

CAMERA = StereoCamera(160, 120, 100.0, 104.0, 79.5, 59.5, 0.12)
NOISE_PX = 0.1


def ground(pitch_deg, height_m, roll_deg=0.0):
    up = Gravity.from_angles(pitch_deg, roll_deg).up
    return GroundPlane(up, height_m, up)


def plane_disparity(plane, camera=CAMERA):
    return np.maximum(DisparityPlane.from_ground(plane, camera).disparity(camera), 0)


def noisy(disparity, seed=0):
    noise = np.random.default_rng(seed).normal(0, NOISE_PX, disparity.shape)
    return np.where(disparity > 0, np.maximum(disparity + noise, 0), 0).astype(np.float32)


def fit(disparity, gravity=None):
    plane = fit_ground_plane(
        disparity,
        CAMERA,
        tolerance_m=0.05,
        noise_px=0.25,
        min_disparity=CAMERA.disparity_at(20.0),
        gravity=gravity,
    )
    return None if plane is None else plane.in_space(CAMERA, gravity)


def angle_deg(one, other):
    return np.degrees(np.arccos(np.clip(np.dot(one, other), -1, 1)))


@given(pitch=st.floats(-20, 85), roll=st.floats(-45, 45), height=st.floats(0.1, 10))
def test_plane_goes_to_disparity_and_back(pitch, roll, height):
    plane = ground(pitch, height, roll)
    back = DisparityPlane.from_ground(plane, CAMERA).in_space(CAMERA, None)
    assert back.normal == pytest.approx(plane.normal, abs=1e-9)
    assert back.height_m == pytest.approx(height)
    assert back.up == back.normal


def test_disparity_of_a_plane_is_that_of_its_points():
    plane = ground(46.0, 1.2, 10.0)
    disparity = DisparityPlane.from_ground(plane, CAMERA).disparity(CAMERA)
    assert disparity.shape == CAMERA.shape
    assert disparity.dtype == np.float32
    for row, column in ((0, 0), (60, 80), (119, 159)):
        ray = ((column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy, 1.0)
        depth = -plane.height_m / np.dot(plane.normal, ray)
        assert disparity[row, column] == pytest.approx(CAMERA.disparity_at(depth), rel=1e-5)


def test_disparity_of_a_plane_is_negative_above_the_horizon():
    disparity = DisparityPlane.from_ground(ground(0.0, 1.0), CAMERA).disparity(CAMERA)
    assert (disparity[:59] < 0).all()
    assert (disparity[60:] > 0).all()


def test_known_gravity_is_the_vertical():
    gravity = Gravity.from_angles(40.0)
    plane = DisparityPlane.from_ground(ground(50.0, 1.0), CAMERA).in_space(CAMERA, gravity)
    assert plane.up == gravity.up
    assert plane.slope_deg == pytest.approx(10.0)


@pytest.mark.parametrize(
    ('pitch', 'roll', 'height'),
    [(46, 0, 1.0), (20, 0, 1.5), (10, -8, 0.5), (65, 5, 2.0), (75, 0, 1.0), (5, 0, 0.4)],
)
def test_plain_ground_is_found(pitch, roll, height):
    truth = ground(pitch, height, roll)
    found = fit(noisy(plane_disparity(truth)))
    assert angle_deg(found.normal, truth.normal) < 0.2
    assert found.height_m == pytest.approx(height, rel=0.005)


@pytest.mark.parametrize(('pitch', 'height'), [(46, 1.0), (25, 1.0), (60, 1.5)])
@pytest.mark.parametrize('seed', range(3))
def test_ground_is_found_among_obstacles_on_two_fifths_of_it(pitch, height, seed):
    truth = ground(pitch, height)
    disparity = plane_disparity(truth)
    generator = np.random.default_rng(seed)
    # Blocks of ten pixels: a share of them rises by up to two thirds of the camera's height.
    blocks = generator.random((12, 16)) < 0.4
    rise = np.where(blocks, generator.uniform(0.15, 0.65, blocks.shape), 0)
    raised = disparity / (1 - np.kron(rise, np.ones((10, 10))))
    found = fit(noisy(raised, seed))
    assert angle_deg(found.normal, truth.normal) < 0.5
    assert found.height_m == pytest.approx(height, rel=0.015)


def test_ground_is_found_below_a_table():
    truth, table = plane_disparity(ground(46, 1.0)), plane_disparity(ground(46, 0.6))
    disparity = truth.copy()
    disparity[:, 84:] = table[:, 84:]
    found = fit(noisy(disparity))
    assert found.height_m == pytest.approx(1.0, rel=0.02)


def test_known_gravity_keeps_from_taking_a_bank_for_the_ground():
    level, steep = plane_disparity(ground(20.0, 1.0)), plane_disparity(ground(65.0, 1.6))
    assert (steep > level).mean() > 0.5
    gravity = Gravity.from_angles(20.0)
    found = fit(noisy(np.maximum(level, steep)), gravity)
    assert found.up == gravity.up
    assert found.slope_deg < 30


def test_missing_and_far_pixels_are_left_out():
    truth = ground(30.0, 1.0)
    disparity = noisy(plane_disparity(truth))
    disparity[:, ::3] = 0
    disparity[:8] = 0.01
    assert angle_deg(fit(disparity).normal, truth.normal) < 0.2


def test_same_disparity_gives_the_same_plane():
    disparity = noisy(plane_disparity(ground(46.0, 1.0)))
    assert fit(disparity) == fit(disparity.copy())


@pytest.mark.parametrize('matched', [0, 10, 49])
def test_too_little_to_fit(matched):
    disparity = np.zeros(CAMERA.shape, np.float32)
    disparity.ravel()[:matched] = 5
    assert fit(disparity) is None


def test_a_line_of_points_is_no_plane():
    disparity = np.zeros(CAMERA.shape, np.float32)
    disparity[60] = 5
    assert fit(disparity) is None


def test_a_wall_is_no_ground():
    wall = np.full(CAMERA.shape, 5.0, np.float32)
    assert fit(noisy(wall), Gravity.from_angles(0.0)) is None


def estimated(disparity, gravity=None, **config):
    return estimate_ground(disparity, CAMERA, DetectorConfig(**config), gravity)


def test_ground_in_view_is_estimated():
    truth = ground(46.0, 1.0)
    found = estimated(noisy(plane_disparity(truth)))
    assert angle_deg(found.normal, truth.normal) < 0.3
    assert found.up == found.normal
    assert found.pitch_deg == pytest.approx(46, abs=0.3)


def test_nearer_ground_counts_where_it_breaks():
    near, far = ground(30.0, 1.0), ground(42.0, 1.5)
    disparity = np.maximum(plane_disparity(near), plane_disparity(far))
    bent = plane_disparity(far) > plane_disparity(near)
    assert 0.1 < bent.mean() < 0.4
    assert angle_deg(estimated(noisy(disparity)).normal, near.normal) < 1.5


def test_ground_is_found_in_front_of_a_wall():
    truth = ground(20.0, 1.0)
    wall = np.full(CAMERA.shape, CAMERA.disparity_at(4.0), np.float32)
    disparity = np.maximum(plane_disparity(truth), wall)
    assert (disparity == wall).mean() > 0.25
    assert angle_deg(estimated(noisy(disparity)).normal, truth.normal) < 2


def test_slope_of_the_ground_is_against_gravity():
    gravity = Gravity.from_angles(46.0)
    found = estimated(noisy(plane_disparity(ground(58.0, 1.0))), gravity)
    assert found.up == gravity.up
    assert found.slope_deg == pytest.approx(12, abs=0.5)


def test_without_disparity_the_mounting_is_believed():
    nothing = np.zeros(CAMERA.shape, np.float32)
    found = estimated(nothing, Gravity.from_angles(46.0, height_m=0.7))
    assert found.height_m == 0.7
    assert found.pitch_deg == pytest.approx(46)
    assert found.slope_deg == pytest.approx(0, abs=1e-5)
    assert estimated(nothing, Gravity.from_angles(46.0)).height_m == 1.0


def test_without_anything_a_level_camera_a_metre_up():
    found = estimated(np.zeros(CAMERA.shape, np.float32))
    assert found == GroundPlane((0.0, -1.0, 0.0), 1.0, (0.0, -1.0, 0.0))
