"""Points that are seen through the ground: mirrored in a puddle or on the rover's bonnet."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, bank, block, flat

from rover_obstacle_detection.detection.terrain import reflections as module
from rover_obstacle_detection.detection.terrain.brim_parameters import ReflectionParameters
from rover_obstacle_detection.detection.terrain.reflections import (
    seen_through_ground,
    without_reflections,
)

POSED = PosedCamera(pitch_deg=25.0, height_m=1.0)


@cache
def looked(height):
    return POSED.look(height)


def found_in(height, *, noise_px=0.05, disparity=None, **parameters):
    """Where points are removed, and the places that the pixels show."""
    shown, x, y = looked(height)
    shown = shown if disparity is None else disparity
    stereo = POSED.stereo(shown.astype(np.float32), noise_px)
    return seen_through_ground(stereo, replace(PARAMETERS, **parameters)), x, y


@cache
def mirrored(wall_m=4.0, x_range=(-0.5, 0.5), y_range=(1.5, 2.5)):
    """Level ground with a puddle that mirrors a wall behind it: the disparity, and the puddle."""
    disparity, x, y = looked(flat)
    puddle = (x > x_range[0]) & (x < x_range[1]) & (y > y_range[0]) & (y < y_range[1])
    # The mirrored wall stands at its own distance, below the ground.
    share = np.divide(wall_m, y, out=np.ones_like(y), where=y > 0)
    return np.where(puddle, disparity / share, disparity), puddle


def test_points_mirrored_in_a_puddle_are_removed():
    disparity, puddle = mirrored()
    found, _, _ = found_in(flat, disparity=disparity)
    assert puddle.sum() > 500
    assert found[puddle].mean() > 0.97
    assert not found[~puddle].any()


def test_removed_points_have_no_match():
    disparity, _ = mirrored()
    stereo = POSED.stereo(disparity.astype(np.float32))
    found = seen_through_ground(stereo, PARAMETERS)
    cleaned = without_reflections(stereo, PARAMETERS)
    np.testing.assert_array_equal(cleaned.disparity, np.where(found, 0, stereo.disparity))
    level = POSED.stereo(looked(flat)[0])
    assert without_reflections(level, PARAMETERS) is level


def test_a_mirror_at_the_lower_border_of_the_image_is_removed_where_ground_lies_behind_it():
    # As the bonnet: nothing but the mirror is seen before its far end.
    disparity, bonnet = mirrored(3.0, (-9, 9), (0.0, 1.2))
    found, _, y = found_in(flat, disparity=disparity)
    assert bonnet[-1].all()
    assert found[bonnet & (y > 0.9)].mean() > 0.9
    assert not found[~bonnet].any()


@pytest.mark.parametrize(
    'height',
    [
        lambda x, y: np.where(y > 2.0, -0.5, 0.0),
        lambda x, y: np.where(y > 2.0 + 0.4 * x, -2.0, 0.0),
        lambda x, y: np.where((y > 1.5) & (y < 2.5), -0.4, 0.0),
        lambda x, y: np.where((y > 1.5) & (y < 1.9), -1.0, 0.0),
        lambda x, y: np.where((abs(x) < 0.4) & (y > 1.5) & (y < 2.2), -0.3, 0.0),
        block(0.0, 2.0, 1.0, -0.6),
        bank(-26, 1.5),
        bank(-12, 1.0),
        lambda x, y: -0.3 * np.exp(-(x**2 + (y - 2) ** 2) / 0.3),
        block(0.0, 2.0, 0.5, 0.4),
        lambda x, y: np.where(y > 3.0, -0.5, np.where(y > 2.0, 0.3, 0.0)),
    ],
    ids=[
        'lower floor',
        'oblique cliff',
        'trench',
        'deep trench',
        'short trench',
        'pit',
        'slope down',
        'gentle slope down',
        'hollow',
        'rock',
        'floor behind a platform',
    ],
)
def test_ground_that_is_really_lower_is_kept(height):
    found, _, _ = found_in(height)
    assert (looked(height)[0] > 0).mean() > 0.3
    assert found.mean() < 1e-3


def test_shallow_reflections_are_kept():
    # 8 cm below the ground, within a step.
    disparity, puddle = mirrored(2.6, y_range=(2.4, 2.5))
    found, _, _ = found_in(flat, disparity=disparity)
    assert puddle.any()
    assert not found.any()


@pytest.mark.parametrize(('changes', 'is_found'), [({}, True), ({'max_step_m': 3.0}, False)])
def test_the_step_is_the_rovers(changes, is_found):
    disparity, puddle = mirrored()
    found, _, _ = found_in(flat, disparity=disparity, **changes)
    assert found[puddle].any() == is_found


def test_noise_may_place_points_below_the_ground():
    disparity, puddle = mirrored()
    found, _, _ = found_in(flat, disparity=disparity, noise_px=4.0)
    assert not found[puddle].any()


def test_the_heights_that_a_low_camera_sees_are_less_noisy():
    low = PosedCamera(pitch_deg=25.0, height_m=0.3)
    disparity, x, y = low.look(flat)
    puddle = (abs(x) < 0.5) & (y > 0.6) & (y < 0.9)
    # A wall at 1.5 m, 0.2 to 0.45 m below the ground.
    mirrored = np.where(puddle, disparity * y / 1.5, disparity).astype(np.float32)
    found = seen_through_ground(low.stereo(mirrored, 0.4), PARAMETERS)
    assert found[puddle].mean() > 0.55
    assert not found[~puddle].any()


def test_without_ground_around_a_mirror_nothing_is_known_of_it():
    disparity, puddle = mirrored()
    found, _, _ = found_in(flat, disparity=np.where(puddle, disparity, 0))
    assert not found.any()


def test_points_beyond_the_range_are_left_alone():
    disparity, puddle = mirrored()
    found, _, _ = found_in(flat, disparity=disparity, max_range_m=3.0)
    assert puddle.any()
    assert not found.any()


@pytest.mark.parametrize(
    ('part', 'ground_m', 'step_m', 'margin_m', 'is_found'),
    [
        (0.25, 2.5, 0.1, 0.25, True),
        (0.5, 3.0, 0.1, 0.25, True),
        (0.75, 3.5, 0.1, 0.25, True),
        (0.5, 2.5, 0.1, 0.25, False),
        (0.5, 3.5, 0.1, 0.25, False),
        # There, the sight line is half a metre below the ground, and 1 m before its point.
        (0.5, 3.0, 0.4, 0.25, True),
        (0.5, 3.0, 0.6, 0.25, False),
        (0.5, 3.0, 0.1, 0.9, True),
        (0.5, 3.0, 0.1, 1.1, False),
    ],
)
def test_a_sight_line_is_checked_at_parts_of_its_way_below_the_ground(
    part, ground_m, step_m, margin_m, is_found
):
    # From the mirror 2 m ahead to its point 4 m ahead, 1 m below the ground.
    disparity, mirror = mirrored(4.0, (-0.5, 0.5), (1.97, 2.03))
    _, _, y = looked(flat)
    reflections = ReflectionParameters(parts=(part,), margin_m=margin_m, min_points=1)
    shown = np.where(mirror | (abs(y - ground_m) < 0.2), disparity, 0)
    found, _, _ = found_in(
        flat, disparity=shown, noise_px=0.001, max_step_m=step_m, reflections=reflections
    )
    assert found[mirror].all() if is_found else not found.any()


def test_cells_of_the_map_lie_ahead_of_the_camera_and_to_either_side():
    across_m = np.array([-1.0, -1.01, 0.99, 1.0, 0, 0, 0, 0], np.float32)
    along_m = np.array([0.6, 0.6, 0.6, 0.6, 0, -0.01, 1.99, 2.0], np.float32)
    cell, inside = module._cells(across_m, along_m, 0.5, 4)
    assert inside.tolist() == [True, False, True, False, True, False, True, False]
    assert cell[inside].tolist() == [4, 7, 2, 14]


def test_a_cell_has_the_mean_height_of_enough_level_points():
    heights_m = np.array([0.02, 0.04, 0.03, 0.05, -0.9, 0.01], np.float32)
    in_range = np.array([True, True, True, True, True, False])
    even = np.ones(6, np.float32)
    across_m = np.array([0, 0, 0, 0.5, 0.5, 0.5], np.float32)
    points = module._Points(in_range, even, heights_m, 0.1 * even, across_m, even)

    def mean_m(min_points):
        p = ReflectionParameters(cell_m=0.5, cells=4, min_points=min_points)
        places = np.array([0, 0.5, -0.5, 9], np.float32)
        return module._LevelGround.mapped(points, p).height_m(places, np.ones_like(places))

    np.testing.assert_allclose(mean_m(1), [0.03, 0.05, -np.inf, -np.inf], rtol=1e-6)
    np.testing.assert_allclose(mean_m(3), [0.03, -np.inf, -np.inf, -np.inf], rtol=1e-6)


def test_what_is_level_follows_the_noise_of_the_height():
    height, share = POSED.height_m, np.array([1.0, 1.5, 0.5, -2.0], np.float32)
    stereo = POSED.stereo(np.full(POSED.camera.shape, 30, np.float32), 0.3)
    expected = stereo.expected.copy()
    expected[0, :4] = 30 * share
    points = module._Points.at(replace(stereo, expected=expected), np.s_[0, :4], PARAMETERS)
    np.testing.assert_allclose(points.height_m, height * (1 - share), rtol=1e-5)
    # 1 % of the distance, three deviations. Above the camera, distance has no effect.
    below_m = np.maximum(height * share, 0)
    np.testing.assert_allclose(points.limit_m, 0.1 + 3 * 0.01 * below_m, rtol=1e-5)
