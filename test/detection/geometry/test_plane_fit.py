from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import PlaneFitParameters
from rover_obstacle_detection.detection.geometry.plane_fit import (
    estimate_ground,
    fit_ground_plane,
    is_upside_down,
)

CAMERA = StereoCamera(160, 120, 100.0, 104.0, 79.5, 59.5, 0.12)
PARAMETERS = PlaneFitParameters()
NOISE_PX = 0.1


def ground(pitch_deg, height_m, roll_deg=0.0):
    up = Gravity.from_angles(pitch_deg, roll_deg).up
    return GroundPlane(up, height_m, up)


def plane_disparity(plane):
    return np.maximum(DisparityPlane.from_ground(plane, CAMERA).disparity(CAMERA), 0)


def noisy(disparity, seed=0):
    noise = np.random.default_rng(seed).normal(0, NOISE_PX, disparity.shape)
    return np.where(disparity > 0, np.maximum(disparity + noise, 0), 0).astype(np.float32)


def fit(disparity, gravity=None):
    plane = fit_ground_plane(
        disparity,
        CAMERA,
        PARAMETERS,
        min_disparity=CAMERA.disparity_at(20.0),
        gravity=gravity,
    )
    return None if plane is None else plane.in_space(CAMERA, gravity)


def estimated(disparity, gravity=None, parameters=PARAMETERS):
    return estimate_ground(disparity, CAMERA, parameters, gravity)


def angle_deg(one, other):
    return np.degrees(np.arccos(np.clip(np.dot(one, other), -1, 1)))


@pytest.mark.parametrize(
    ('pitch', 'roll', 'height'),
    [(46, 0, 1.0), (20, 0, 1.5), (10, -8, 0.5), (65, 5, 2.0), (68, 0, 1.0), (5, 0, 0.4)],
)
def test_ground_without_obstacles_is_found(pitch, roll, height):
    truth = ground(pitch, height, roll)
    found = fit(noisy(plane_disparity(truth)))
    assert angle_deg(found.normal, truth.normal) < 0.2
    assert found.height_m == pytest.approx(height, rel=0.005)


def test_ground_needs_the_least_number_of_points():
    disparity = np.zeros(CAMERA.shape, np.float32)
    disparity[-20:] = plane_disparity(ground(46, 1.0))[-20:]
    count = np.count_nonzero(disparity)

    def found(min_points):
        parameters = replace(PARAMETERS, min_points=min_points, sample_points=count)
        return fit_ground_plane(disparity, CAMERA, parameters, min_disparity=0.0, gravity=None)

    assert found(count) is not None
    assert found(count + 1) is None


@pytest.mark.parametrize(('pitch', 'height'), [(46, 1.0), (25, 1.0), (60, 1.5)])
@pytest.mark.parametrize('seed', range(3))
def test_ground_is_found_with_obstacles_on_40_percent_of_it(pitch, height, seed):
    truth = ground(pitch, height)
    disparity = plane_disparity(truth)
    generator = np.random.default_rng(seed)
    # Blocks of 10 x 10 pixels, some of them raised by up to two thirds of the camera height.
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


def test_known_gravity_rules_out_a_steep_bank():
    level, steep = plane_disparity(ground(20.0, 1.0)), plane_disparity(ground(65.0, 1.6))
    assert (steep > level).mean() > 0.5
    gravity = Gravity.from_angles(20.0)
    found = fit(noisy(np.maximum(level, steep)), gravity)
    assert found.up == gravity.up
    assert found.slope_deg < 30


def wall_disparity(distance_m, pitch_deg):
    up = np.array(Gravity.from_angles(pitch_deg).up)
    ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up
    ahead /= np.linalg.norm(ahead)
    wall = GroundPlane(tuple(-ahead), distance_m, tuple(up))
    return np.maximum(DisparityPlane.from_ground(wall, CAMERA).disparity(CAMERA), 0)


@pytest.mark.parametrize('pitch', [5, 15, 25])
@pytest.mark.parametrize('ground_share', [0.2, 0.3, 0.5])
def test_a_wall_is_not_the_ground_in_front_of_it(pitch, ground_share):
    level = plane_disparity(ground(pitch, 1.0))
    foot_row = round((1 - ground_share) * CAMERA.height)
    distance_m = 1.0
    for distance_m in np.arange(0.5, 12.0, 0.05):
        wall = wall_disparity(distance_m, pitch)
        if (level >= wall)[foot_row].all():
            break
    found = estimated(noisy(np.maximum(level, wall)))
    assert angle_deg(found.normal, ground(pitch, 1.0).normal) < 2
    assert found.height_m == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize('depth_m', [0.3, 0.8, 2.0])
@pytest.mark.parametrize('brim_share', [0.4, 0.5])
def test_a_floor_below_an_edge_is_not_the_ground_before_it(depth_m, brim_share):
    near = plane_disparity(ground(25, 1.0))
    low = plane_disparity(ground(25, 1.0 + depth_m))
    brim_row = round((1 - brim_share) * CAMERA.height)
    near[:brim_row] = low[:brim_row]
    found = estimated(noisy(near))
    assert angle_deg(found.normal, ground(25, 1.0).normal) < 4.5
    assert found.height_m == pytest.approx(1.0, rel=0.08)


@pytest.mark.parametrize('distance_m', [0.8, 2.0, 4.0])
@pytest.mark.parametrize('pitch', [0, 5, 10])
def test_a_wall_that_fills_the_view_is_no_ground(distance_m, pitch):
    assert fit(noisy(wall_disparity(distance_m, pitch))) is None


@pytest.mark.parametrize(('known_height_m', 'expected_m'), [(0.0, 0.5), (1.0, 1.0)])
def test_a_known_height_tells_the_floor_from_a_table(known_height_m, expected_m):
    disparity = plane_disparity(ground(30, 1.0))
    disparity[:, 40:] = plane_disparity(ground(30, 0.5))[:, 40:]
    parameters = replace(PARAMETERS, known_height_m=known_height_m)
    found = estimated(noisy(disparity), parameters=parameters)
    assert found.height_m == pytest.approx(expected_m, rel=0.05)


def test_a_known_height_counts_where_no_plane_is_found():
    parameters = replace(PARAMETERS, known_height_m=1.7)
    found = estimated(np.zeros(CAMERA.shape, np.float32), parameters=parameters)
    assert (found.height_m, found.measured) == (1.7, False)


def test_missing_and_far_pixels_are_excluded():
    truth = ground(30.0, 1.0)
    disparity = noisy(plane_disparity(truth))
    disparity[:, ::3] = 0
    disparity[:8] = 0.01
    assert angle_deg(fit(disparity).normal, truth.normal) < 0.2


def test_same_disparity_gives_the_same_plane():
    disparity = noisy(plane_disparity(ground(46.0, 1.0)))
    assert fit(disparity) == fit(disparity.copy())


@pytest.mark.parametrize('matched', [0, 10, 49])
def test_too_few_points_give_no_plane(matched):
    disparity = np.zeros(CAMERA.shape, np.float32)
    disparity.ravel()[:matched] = 5
    assert fit(disparity) is None


def test_collinear_points_give_no_plane():
    disparity = np.zeros(CAMERA.shape, np.float32)
    disparity[60] = 5
    assert fit(disparity) is None


def test_a_wall_is_not_ground():
    wall = np.full(CAMERA.shape, 5.0, np.float32)
    assert fit(noisy(wall), Gravity.from_angles(0.0)) is None


def test_visible_ground_is_estimated():
    truth = ground(46.0, 1.0)
    found = estimated(noisy(plane_disparity(truth)))
    assert angle_deg(found.normal, truth.normal) < 0.3
    assert found.up == found.normal
    assert found.pitch_deg == pytest.approx(46, abs=0.3)


def test_plane_follows_the_nearer_part_of_ground_with_a_break():
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


def test_slope_is_relative_to_known_gravity():
    gravity = Gravity.from_angles(46.0)
    found = estimated(noisy(plane_disparity(ground(58.0, 1.0))), gravity)
    assert found.up == gravity.up
    assert found.slope_deg == pytest.approx(12, abs=0.5)


def test_without_disparity_the_known_mounting_is_used():
    nothing = np.zeros(CAMERA.shape, np.float32)
    found = estimated(nothing, Gravity.from_angles(46.0, height_m=0.7))
    assert not found.measured
    assert found.height_m == 0.7
    assert found.pitch_deg == pytest.approx(46)
    assert found.slope_deg == pytest.approx(0, abs=1e-5)
    assert estimated(nothing, Gravity.from_angles(46.0)).height_m == 1.0


def test_without_disparity_and_gravity_a_level_camera_is_assumed():
    assumed = replace(PARAMETERS, default_height_m=0.4)
    found = estimated(np.zeros(CAMERA.shape, np.float32), parameters=assumed)
    assert found == GroundPlane((0.0, -1.0, 0.0), 0.4, (0.0, -1.0, 0.0), measured=False)


def test_points_beyond_the_range_are_excluded():
    disparity = noisy(plane_disparity(ground(30.0, 1.0)))
    nearby = replace(PARAMETERS, max_range_m=0.5)
    assert estimated(disparity, parameters=nearby).normal == (0.0, -1.0, 0.0)


def test_relief_within_the_tolerance_counts_as_ground():
    truth = plane_disparity(ground(46.0, 1.0))
    # Half of the ground is 15 cm high. With enough tolerance it raises the plane.
    raised = np.kron(np.random.default_rng(0).random((12, 16)) < 0.5, np.ones((10, 10), bool))
    disparity = noisy(np.where(raised, truth / 0.85, truth))
    tight_m, loose_m = (
        estimated(disparity, parameters=replace(PARAMETERS, tolerance_m=each)).height_m
        for each in (0.02, 0.5)
    )
    assert tight_m == pytest.approx(1, abs=0.02)
    assert loose_m < 0.98


@pytest.mark.parametrize('pitch', [10, 25, 46])
@pytest.mark.parametrize('shift', [0.0, 35.0])
def test_ground_at_the_top_of_the_image_is_upside_down(pitch, shift):
    # A principal point away from the middle is turned as well.
    camera = replace(CAMERA, cy=CAMERA.cy + shift)
    plane = DisparityPlane.from_ground(ground(pitch, 1.0), camera)
    upright = noisy(np.maximum(plane.disparity(camera), 0))
    turned = np.ascontiguousarray(upright[::-1, ::-1])
    mounted = replace(camera, cy=CAMERA.height - 1 - camera.cy)
    assert is_upside_down(turned, mounted, PARAMETERS)
    assert not is_upside_down(upright, camera, PARAMETERS)


@pytest.mark.parametrize('distance_m', [0.0, 2.0])
def test_without_ground_nothing_is_upside_down(distance_m):
    wall = wall_disparity(distance_m, 0.0) if distance_m else np.zeros(CAMERA.shape, np.float32)
    assert not is_upside_down(noisy(wall), CAMERA, PARAMETERS)


@pytest.mark.parametrize(('pitch', 'expected'), [(29.9, True), (30.1, False)])
def test_limits_hold_for_a_view_turned_about_its_centre(pitch, expected):
    # In a rolled view, both coordinates of the principal point count.
    parameters = replace(PARAMETERS, max_pitch_deg=30.0, max_roll_deg=60.0)
    for roll in (40.0, -40.0):
        upright = plane_disparity(ground(pitch, 1.0, roll))
        turned = np.ascontiguousarray(upright[::-1, ::-1])
        assert is_upside_down(turned, CAMERA, parameters) == expected


@pytest.mark.parametrize('roll', [0, 90, 180, -90])
def test_known_gravity_says_where_the_view_is_lowest(roll):
    gravity = Gravity.from_angles(25.0, roll)
    near, low = (plane_disparity(ground(25.0, height, roll)) for height in (1.0, 1.8))
    columns, rows = np.meshgrid(np.arange(160) - CAMERA.cx, np.arange(120) - CAMERA.cy)
    downwards = -gravity.up[0] * columns - gravity.up[1] * rows
    disparity = np.where(downwards > np.quantile(downwards[near > 0], 0.6), near, low)
    found = estimated(noisy(disparity), gravity)
    assert found.height_m == pytest.approx(1.0, rel=0.08)


@pytest.mark.parametrize(('min_area_px2', 'is_found'), [(14.0, True), (19.6, False)])
def test_planes_go_through_points_that_span_more_than_the_least_area(min_area_px2, is_found):
    disparity = np.zeros(CAMERA.shape, np.float32)
    # A triangle between two rows of 40 pixels has at most 39 / 2.
    disparity[90:92, :40] = plane_disparity(ground(40.0, 1.0))[90:92, :40]
    parameters = replace(PARAMETERS, min_sample_area_px2=min_area_px2)
    plane = fit_ground_plane(disparity, CAMERA, parameters, min_disparity=0.0)
    assert (plane is not None) == is_found


def test_few_points_all_count_in_the_residual():
    disparity = np.zeros(CAMERA.shape, np.float32)
    disparity[60::10, 1::10] = plane_disparity(ground(40.0, 1.0))[60::10, 1::10]
    rows, columns = np.nonzero(disparity)
    odd = rows[1::2], columns[1::2]
    exact = fit_ground_plane(disparity, CAMERA, PARAMETERS, min_disparity=0.0)
    # Every second point stands far above the ground.
    disparity[odd] *= 2
    raised = fit_ground_plane(disparity, CAMERA, PARAMETERS, min_disparity=0.0)
    assert exact.residual == pytest.approx(0, abs=0.01)
    assert raised.residual == pytest.approx(PARAMETERS.max_deviation**2 / 2, rel=0.1)
