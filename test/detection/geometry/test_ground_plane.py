from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane

CAMERA = StereoCamera(160, 120, 100.0, 104.0, 79.5, 59.5, 0.12)


def ground(pitch_deg, height_m, roll_deg=0.0):
    up = Gravity.from_angles(pitch_deg, roll_deg).up
    return GroundPlane(up, height_m, up)


@given(pitch=st.floats(-20, 85), roll=st.floats(-45, 45), height=st.floats(0.1, 10))
def test_conversion_to_disparity_and_back(pitch, roll, height):
    plane = ground(pitch, height, roll)
    back = DisparityPlane.from_ground(plane, CAMERA).in_space(CAMERA, None)
    assert back.normal == pytest.approx(plane.normal, abs=1e-9)
    assert back.height_m == pytest.approx(height)
    assert back.up == back.normal


def test_disparity_of_a_plane_matches_its_points():
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


@given(pitch=st.floats(-60, 60), slope=st.floats(0.01, 29))
def test_slope_is_the_angle_between_normal_and_vertical(pitch, slope):
    plane = GroundPlane(Gravity.from_angles(pitch + slope).up, 1.0, Gravity.from_angles(pitch).up)
    assert plane.slope_deg == pytest.approx(slope, abs=1e-3)


@pytest.mark.parametrize(('turned', 'slope_deg'), [(1, 0), (-1, 180)])
def test_slope_is_a_number_despite_rounding(turned, slope_deg):
    up = np.array(Gravity.from_angles(46.0, 3.0).up) * (1 + 1e-12)
    plane = GroundPlane(tuple(turned * up), 1.0, tuple(up))
    assert plane.slope_deg == pytest.approx(slope_deg, abs=1e-5)


@pytest.mark.parametrize('pitch', [-90, -30, 0, 46, 90])
def test_pitch_is_the_angle_of_the_axis_below_the_horizon(pitch):
    # Rounding may make a unit vector a little longer.
    up = np.array(Gravity.from_angles(pitch).up) * (1 + 1e-12)
    assert GroundPlane((0.0, -1.0, 0.0), 1.0, tuple(up)).pitch_deg == pytest.approx(
        pitch, abs=1e-4
    )


def test_plane_of_reversed_rows_has_its_normals_turned_over():
    plane = GroundPlane((0.1, -0.9, -0.4), 1.5, (0.2, -0.8, 0.5), measured=False, residual=0.2)
    assert plane.mirrored() == GroundPlane(
        (0.1, 0.9, -0.4), 1.5, (0.2, 0.8, 0.5), measured=False, residual=0.2
    )


def test_in_space_the_plane_keeps_its_residual():
    assert DisparityPlane(0.0, 0.1, 5.0, residual=0.3).in_space(CAMERA, None).residual == 0.3


def test_up_vector_is_the_vertical_as_float32():
    vector = GroundPlane((0, -1, 0), 1.0, (0.0, -0.6, -0.8)).up_vector
    assert vector.dtype == np.float32
    np.testing.assert_allclose(vector, (0, -0.6, -0.8))
