"""The ground plane that makes both images agree best."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import waves
from relief import PosedCamera, flat
from synthetic import pinhole

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import PlaneFitParameters
from rover_obstacle_detection.detection.stereo.parameters import SweepParameters
from rover_obstacle_detection.detection.stereo.plane_sweep import is_doubtful, likelier_ground

CAMERA = pinhole(160, 120, 60.0, 0.12)
PARAMETERS = SweepParameters()
PER_METRE = 100.0


def plane(pitch_deg=30.0, height_m=1.0, *, measured=True, residual=0.0):
    up = Gravity.from_angles(pitch_deg).up
    return GroundPlane(up, height_m, up, measured, residual)


MISSING = plane(0.0, 1.0, measured=False)


@cache
def floor(pitch_deg=30.0, height_m=1.0, tile_m=0.0, noise=1.0):
    """Level ground, of tiles that all look the same if their side is given."""
    posed = PosedCamera(CAMERA, pitch_deg, height_m)
    _, x, y = posed.look(flat)

    def image(x, seed):
        across = np.mod(x, tile_m) if tile_m else x
        return waves.as_image(waves.texture(PER_METRE * across, PER_METRE * y), noise, seed)

    return image(x, 1), image(x + CAMERA.baseline_m, 2)


def best(pair, found=MISSING, gravity=None, camera=CAMERA, **plane_fit):
    frame = Frame(pair, camera, gravity)
    return likelier_ground(frame, found, PlaneFitParameters(**plane_fit), PARAMETERS)


def composed(below, above, row=50):
    """Two pairs, one below and one above an image row."""
    return tuple(
        np.where(np.arange(len(low))[:, np.newaxis] < row, high, low)
        for low, high in zip(below, above, strict=True)
    )


def wall(disparity_px, seed=1):
    columns, rows = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    return (
        waves.as_image(waves.texture(columns, rows), 1.0, seed),
        waves.as_image(waves.texture(columns + disparity_px, rows), 1.0, seed + 1),
    )


@pytest.mark.parametrize(
    ('ground', 'doubtful'),
    [
        (plane(), False),
        (plane(residual=2.4), False),
        (plane(residual=2.6), True),
        (plane(measured=False), True),
        (plane(height_m=0.4), False),
        (plane(height_m=0.35), True),
        (plane(height_m=2.6), False),
        (plane(height_m=2.7), True),
    ],
)
def test_ground_is_doubtful_with_few_points_or_at_an_unlikely_height(ground, doubtful):
    assert is_doubtful(ground, PlaneFitParameters(), PARAMETERS) == doubtful


@pytest.mark.parametrize(('pitch_deg', 'height_m'), [(30, 1.0), (46, 1.0), (15, 0.6), (26, 1.7)])
def test_ground_is_found_where_matching_found_none(pitch_deg, height_m):
    found = best(floor(pitch_deg, height_m))
    assert found.measured
    assert found.height_m == pytest.approx(height_m, rel=0.025)
    assert found.pitch_deg == pytest.approx(pitch_deg, abs=1.5)
    assert found.normal == found.up


def test_a_camera_that_looks_down_more_steeply_than_it_may_sees_a_wall():
    assert best(floor(46.0)).measured
    assert best(floor(46.0), max_pitch_deg=40.0) is MISSING


def test_ground_that_was_found_is_kept():
    matched = plane(31.0, 1.02)
    assert best(floor(), matched) is matched


@pytest.mark.parametrize('wrong', [plane(60.0, 2.0), plane(30.0, 2.5), plane(5.0, 0.4)])
def test_a_plane_that_does_not_agree_is_replaced(wrong):
    assert best(floor(), wrong).height_m == pytest.approx(1.0, rel=0.05)


def test_the_lower_part_of_the_image_decides():
    found = best(composed(floor(), wall(9.0)))
    assert found.measured
    assert found.height_m == pytest.approx(1.0, rel=0.05)
    assert found.pitch_deg == pytest.approx(30, abs=4)


def test_the_plane_that_more_of_the_lower_part_lies_on_counts():
    for row, height_m in ((100, 0.6), (60, 1.0)):
        found = best(composed(floor(), floor(height_m=0.6), row))
        assert found.height_m == pytest.approx(height_m, rel=0.1)


def test_of_tiles_that_repeat_the_likelier_height_is_taken():
    # Shifted by one tile, they look the same from 0.12 / (0.12 + 0.1) of the height.
    pair = floor(tile_m=0.1)
    lower = plane(30.0, 0.545)
    assert best(pair).height_m == pytest.approx(1.0, rel=0.05)
    assert best(pair, known_height_m=0.545).height_m == pytest.approx(0.545, rel=0.05)
    # Both agree as well, so that matching has the say.
    assert best(pair, lower) is lower
    assert best(pair, lower, known_height_m=1.0).height_m == pytest.approx(1.0, rel=0.05)


def test_a_known_vertical_is_kept():
    gravity = Gravity.from_angles(30.0)
    found = best(floor(), gravity=gravity)
    assert found.normal == found.up == gravity.up
    assert found.height_m == pytest.approx(1.0, rel=0.05)


def test_the_offset_of_the_camera_is_taken_into_account():
    camera = replace(CAMERA, cx_right=CAMERA.cx - 3.0)
    left, right = floor()
    found = best((left, np.roll(right, -3, axis=1)), camera=camera)
    assert found.height_m == pytest.approx(1.0, rel=0.05)
    assert found.pitch_deg == pytest.approx(30, abs=4)


@pytest.mark.parametrize('found', [MISSING, plane(20.0, 0.5)], ids=['none', 'wrong'])
def test_a_wall_that_fills_the_view_is_no_ground(found):
    assert best(wall(9.0), found) is found


@pytest.mark.parametrize('found', [MISSING, plane(20.0, 0.5)], ids=['none', 'wrong'])
def test_images_that_agree_nowhere_change_nothing(found):
    left, _ = floor()
    other = waves.as_image(np.full(CAMERA.shape, 128.0), 40.0, seed=5)
    assert best((left, other), found) is found


@pytest.mark.parametrize('baseline_m', [0.12, 0.6])
def test_images_without_texture_change_nothing(baseline_m):
    blank = np.full(CAMERA.shape, 90, np.uint8)
    # With a wide baseline, hardly a pixel of near ground is in both images.
    assert best((blank, blank), camera=replace(CAMERA, baseline_m=baseline_m)) is MISSING
