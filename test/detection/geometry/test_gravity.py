from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane


@pytest.mark.parametrize(
    ('pitch', 'roll', 'up'),
    [
        (0, 0, (0, -1, 0)),
        (90, 0, (0, 0, -1)),
        (-90, 0, (0, 0, 1)),
        # Rolled clockwise by a right angle, up lies towards the image's left.
        (0, 90, (-1, 0, 0)),
        (30, 0, (0, -math.sqrt(0.75), -0.5)),
    ],
)
def test_up_of_known_angles(pitch, roll, up):
    assert Gravity.from_angles(pitch, roll).up == pytest.approx(up)


@given(pitch=st.floats(-90, 90), roll=st.floats(-90, 90))
def test_up_is_a_unit_vector_and_gives_the_pitch_back(pitch, roll):
    up = Gravity.from_angles(pitch, roll).up
    assert np.linalg.norm(up) == pytest.approx(1)
    assert GroundPlane(up, 1.0, up).pitch_deg == pytest.approx(pitch, abs=1e-5)


def test_height_is_kept():
    assert Gravity.from_angles(46, height_m=1.2).height_m == 1.2
    assert Gravity.from_angles(46).height_m is None


@given(pitch=st.floats(-60, 60), slope=st.floats(0.01, 29))
def test_slope_is_the_angle_between_normal_and_vertical(pitch, slope):
    plane = GroundPlane(Gravity.from_angles(pitch + slope).up, 1.0, Gravity.from_angles(pitch).up)
    assert plane.slope_deg == pytest.approx(slope, abs=1e-3)


def test_level_ground_has_no_slope_in_spite_of_rounding():
    up = Gravity.from_angles(46.0, 3.0).up
    assert GroundPlane(up, 1.0, up).slope_deg == pytest.approx(0, abs=1e-5)


def test_vertical_as_an_array():
    vector = GroundPlane((0, -1, 0), 1.0, (0.0, -0.6, -0.8)).up_vector
    assert vector.dtype == np.float32
    np.testing.assert_allclose(vector, (0, -0.6, -0.8))
