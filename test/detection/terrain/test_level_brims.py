"""Brims over a level plane, where the ground plane is tilted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, flat, tilted
from synthetic import pinhole

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.brims import find_brims
from rover_obstacle_detection.detection.terrain.level_brims import (
    AllBrims,
    brims_by_vertical,
    over_level_plane,
)

# Narrow, with as many rows as in real images: a few of them are little ground.
POSED = PosedCamera(pinhole(60, 560, 60.0, 0.15), pitch_deg=25.0, height_m=1.9)
EDGES_M = (3.5, 4.2, 4.9)
STEP_M = 0.2


def stairs(x, y):
    """Three steps down."""
    return -STEP_M * sum((y > edge_m).astype(float) for edge_m in EDGES_M)


def plane_falling(angle_deg):
    """A plane through the near ground that falls by an angle ahead."""
    up = Gravity.from_angles(POSED.pitch_deg - angle_deg, 0.0).up
    # 3.2 m ahead, both have the same height.
    height_m = (POSED.height_m - 3.2 * math.tan(math.radians(angle_deg))) * math.cos(
        math.radians(angle_deg)
    )
    return GroundPlane(up, height_m, up)


ALONG_STAIRS = plane_falling(15.0)


def brims_of(height, ground, verticals):
    disparity, _, y = POSED.look(height)
    stereo = POSED.stereo(disparity, 0.05, ground)
    over_plane = AllBrims((find_brims(stereo, PARAMETERS),))
    found, up = brims_by_vertical(over_plane, verticals, stereo, find_brims, PARAMETERS)
    return over_plane, found, up, y


def test_steps_that_a_plane_along_the_stairs_hides_are_brims_over_a_level_plane():
    hidden, found, up, y = brims_of(stairs, ALONG_STAIRS, [POSED.up])
    assert not hidden.edge(PARAMETERS.brims).any()
    assert not hidden.beyond().any()
    edge = found.edge(PARAMETERS.brims)
    for edge_m in EDGES_M:
        before = (y > edge_m - 0.1) & (y < edge_m)
        assert edge[before].mean() > 0.95
    assert not edge[y < EDGES_M[0] - 0.2].any()
    lower = (y > EDGES_M[0] + 0.6) & (y < 8)
    assert found.beyond()[lower].mean() > 0.9
    assert up == POSED.up


def test_the_vertical_that_shows_more_brims_is_chosen():
    slope_first = [ALONG_STAIRS.up, POSED.up]
    assert brims_of(stairs, ALONG_STAIRS, slope_first)[2] == POSED.up
    assert brims_of(stairs, ALONG_STAIRS, slope_first[::-1])[2] == POSED.up


@pytest.mark.parametrize('angle_deg', [8.0, 13.0, 20.0])
def test_a_slope_has_no_brims_over_a_level_plane(angle_deg):
    ground = plane_falling(angle_deg)
    slope = tilted(0.0, -math.tan(math.radians(angle_deg)))
    for verticals in ([ground.up, POSED.up], [POSED.up, ground.up]):
        _, found, up, _ = brims_of(slope, ground, verticals)
        assert not any(part.rows.size for part in found.parts)
        assert up == ground.up, 'of two that show none, the nearer to the plane'


def test_a_plane_that_is_nearly_level_is_enough():
    ground = plane_falling(PARAMETERS.brims.min_tilt_deg - 0.5)
    _, found, up, _ = brims_of(stairs, ground, [POSED.up])
    assert len(found.parts) == 1
    assert up == POSED.up


def test_what_is_on_an_obstacle_is_no_brim_over_any_plane():
    _, found, _, _ = brims_of(stairs, ALONG_STAIRS, [POSED.up])
    everywhere = np.ones(POSED.camera.shape, np.bool_)
    assert not found.not_on(everywhere, PARAMETERS.brims).edge(PARAMETERS.brims).any()


def test_heights_over_the_level_plane_are_along_the_vertical():
    disparity, _, _ = POSED.look(flat)
    level = over_level_plane(POSED.stereo(disparity, 0.05, ALONG_STAIRS), POSED.up)
    assert level.ground.normal == level.ground.up == POSED.up
    seen = disparity > 0
    height_m = level.ground.height_m * (1 - level.expected[seen] / disparity[seen])
    np.testing.assert_allclose(height_m, level.ground.height_m - POSED.height_m, atol=1e-3)
