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
        # After a clockwise roll of 90 degrees, up points to the left of the image.
        (0, 90, (-1, 0, 0)),
        (30, 0, (0, -math.sqrt(0.75), -0.5)),
    ],
)
def test_vertical_of_known_angles(pitch, roll, up):
    assert Gravity.from_angles(pitch, roll).up == pytest.approx(up)


@given(pitch=st.floats(-90, 90), roll=st.floats(-90, 90))
def test_vertical_is_a_unit_vector_with_the_given_pitch(pitch, roll):
    up = Gravity.from_angles(pitch, roll).up
    assert np.linalg.norm(up) == pytest.approx(1)
    assert GroundPlane(up, 1.0, up).pitch_deg == pytest.approx(pitch, abs=1e-5)


def test_height_is_optional():
    assert Gravity.from_angles(46, height_m=1.2).height_m == 1.2
    assert Gravity.from_angles(46).height_m is None


def test_a_camera_is_upright_unless_a_roll_is_given():
    assert Gravity.from_angles(46).up[0] == 0
