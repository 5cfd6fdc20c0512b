"""Words for what contradicts the known vertical, height and units."""

from __future__ import annotations

import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_check import (
    ground_warnings,
)
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import GroundCheckParameters

PARAMETERS = GroundCheckParameters()
CAMERA = StereoCamera(160, 120, 100.0, 100.0, 79.5, 59.5, 0.12)


def plane(pitch_deg=30.0, height_m=1.0, up_pitch_deg=None, *, measured=True):
    """Ground seen at a pitch; the vertical may say another."""
    normal = Gravity.from_angles(pitch_deg).up
    up = normal if up_pitch_deg is None else Gravity.from_angles(up_pitch_deg).up
    return GroundPlane(normal, height_m, up, measured)


def warnings(ground, *, unaided=None, gravity=None, known_height_m=0.0, parameters=PARAMETERS):
    return ground_warnings(ground, unaided, gravity, known_height_m, parameters)


def test_usual_ground_gives_no_warning():
    assert warnings(plane()) == ()
    level = Gravity.from_angles(30.0)
    assert warnings(plane(), gravity=level, known_height_m=1.0) == ()


@pytest.mark.parametrize(('slope_deg', 'count'), [(19, 0), (21, 1)])
def test_ground_tilted_against_the_vertical_is_named(slope_deg, count):
    ground = plane(30.0, up_pitch_deg=30.0 + slope_deg)
    found = warnings(ground, gravity=Gravity(ground.up))
    assert len(found) == count
    for each in found:
        assert f'tilted by {slope_deg} degrees against the given vertical' in each
        assert 'check camera_pitch' in each


def test_a_tilt_counts_only_against_a_given_vertical():
    assert warnings(plane(30.0, up_pitch_deg=55.0)) == ()


@pytest.mark.parametrize(
    ('height_m', 'count'), [(0.76, 1), (0.78, 0), (1.0, 0), (1.29, 0), (1.31, 1)]
)
def test_height_is_compared_with_the_known_one(height_m, count):
    found = warnings(plane(height_m=height_m), known_height_m=1.0)
    assert len(found) == count
    for each in found:
        assert f'{height_m:.2f} m above the ground by stereo, but camera_height is 1 m' in each


@pytest.mark.parametrize(
    ('height_m', 'count'), [(0.11, 1), (0.13, 0), (3.4, 0), (3.6, 1), (1000.0, 1)]
)
def test_height_that_no_rover_has_is_named_where_it_is_not_known(height_m, count):
    found = warnings(plane(height_m=height_m))
    assert len(found) == count
    for each in found:
        assert f'{height_m:.2f} m above the ground by stereo, which is unusual' in each
        assert 'set camera_height' in each


def test_a_known_height_may_be_unusual():
    assert warnings(plane(height_m=6.0), known_height_m=6.0) == ()


def test_tilt_and_height_are_both_named():
    ground = plane(10.0, 2.0, up_pitch_deg=40.0)
    tilt, height = warnings(ground, gravity=Gravity(ground.up), known_height_m=1.0)
    assert 'tilted by 30 degrees' in tilt
    assert '2.00 m above the ground' in height


def test_without_ground_and_vertical_the_limit_of_the_pitch_is_named():
    (found,) = warnings(plane(measured=False))
    assert found.startswith('no ground in view, so everything in view is an obstacle')
    assert 'raise max_camera_pitch or give the vertical' in found


@pytest.mark.parametrize('unaided', [None, plane(measured=False)])
def test_without_any_ground_the_vertical_is_not_blamed(unaided):
    (found,) = warnings(plane(measured=False), unaided=unaided, gravity=Gravity.from_angles(30.0))
    assert found == 'no ground in view, so everything in view is an obstacle'


def test_a_vertical_that_hides_the_ground_is_named_with_both_pitches():
    assumed = plane(0.0, measured=False)
    (found,) = warnings(assumed, unaided=plane(45.0), gravity=Gravity.from_angles(0.0))
    assert 'the vertical says that the camera looks down by 0 degrees' in found
    assert 'the ground says 45' in found
    assert 'check camera_pitch' in found


def test_without_ground_the_assumed_height_is_not_judged():
    assert len(warnings(plane(height_m=50.0, measured=False), known_height_m=1.0)) == 1


@pytest.mark.parametrize(('forward', 'pitch_deg'), [(-1, 90), (1, -90)])
def test_a_vertical_longer_than_1_by_rounding_has_a_pitch(forward, pitch_deg):
    straight = Gravity((0.0, 0.0, forward * (1 + 1e-12)))
    (found,) = warnings(plane(measured=False), unaided=plane(45.0), gravity=straight)
    assert f'looks down by {pitch_deg} degrees' in found
