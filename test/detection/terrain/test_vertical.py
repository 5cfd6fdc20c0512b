from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from relief import Eye, bank, block, flat, tilted, together

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.survey import survey
from rover_obstacle_detection.detection.terrain.vertical import estimate_vertical

EYE = Eye()
LEANING = GroundPlane(
    Gravity.from_angles(EYE.pitch_deg - 4, 2.0).up,
    1.3,
    Gravity.from_angles(EYE.pitch_deg + 9, -5.0).up,
)


def apart_deg(one, other):
    return math.degrees(math.acos(min(1.0, float(np.dot(one, other)))))


def vertical(height, eye=EYE, ground=None):
    terrain, *_ = eye.survey(height, ground=ground)
    found = estimate_vertical(terrain.layers, ground or eye.level_ground)
    assert np.linalg.norm(found) == pytest.approx(1)
    return found


@pytest.mark.parametrize('eye', [EYE, Eye(pitch_deg=10), Eye(pitch_deg=60), Eye(roll_deg=12)])
def test_normal_of_flat_ground_is_the_vertical(eye):
    assert apart_deg(vertical(flat, eye), eye.up) < 0.1


def test_vertical_does_not_depend_on_the_plane_that_heights_are_over():
    assert apart_deg(vertical(flat, ground=LEANING), EYE.up) < 0.1
    assert apart_deg(LEANING.normal, EYE.up) > 4


@pytest.mark.parametrize(('rise_x', 'rise_y'), [(0.2, 0.0), (0.0, 0.2), (-0.15, -0.25)])
def test_rover_stands_level_on_a_slope_that_is_all_it_sees(rise_x, rise_y):
    normal = np.array([-rise_x, -rise_y, 1]) @ EYE.axes
    normal /= np.linalg.norm(normal)
    assert apart_deg(vertical(tilted(rise_x, rise_y)), normal) < 0.2


@pytest.mark.parametrize('softness', [0.0, 0.2], ids=['sharp', 'soft'])
@pytest.mark.parametrize('start', [2.5, 3.2])
@pytest.mark.parametrize('angle', [26, -26, 12])
def test_slope_ahead_is_no_part_of_what_the_rover_stands_on(angle, start, softness):
    # From lower down a slope that falls away could not be seen.
    high = Eye(height_m=2.0)
    assert apart_deg(vertical(bank(angle, start, softness), high), high.up) < 2


@pytest.mark.parametrize(('pitch_deg', 'height_m'), [(45, 1.2), (46, 0.9)])
def test_slope_that_begins_gently_is_not_shared_out_between_rover_and_slope(pitch_deg, height_m):
    # A later bend of a smaller angle fits about as well as the true one.
    def relief(x, y):
        return 0.012 * np.sin(2 * np.pi * x / 1.1 + 1) * np.cos(2 * np.pi * y / 0.9 + 1)

    slope = bank(-26, 1.4, 0.4)
    eye = Eye(pitch_deg=pitch_deg, height_m=height_m)
    assert apart_deg(vertical(lambda x, y: slope(x, y) + relief(x, y), eye), eye.up) < 2.3


def test_cells_of_which_little_is_known_hardly_count():
    terrain, *_ = EYE.survey(flat)
    false, told = [], []
    for layer in terrain.layers:
        rows, columns = np.indices(layer.ground_m.shape)
        known = rows < 0.3 * len(layer.ground_m)
        ground_m = np.where(known, layer.ground_m, 0.2 * columns * layer.positions.cell_m)
        information = np.where(known, np.float32(1e9), np.float32(10))
        false.append(replace(layer, ground_m=ground_m, information=information))
        told.append(replace(layer, ground_m=ground_m, information=np.full_like(information, 1e9)))
    assert apart_deg(estimate_vertical(false, EYE.level_ground), EYE.up) < 1
    assert apart_deg(estimate_vertical(told, EYE.level_ground), EYE.up) > 3


@pytest.mark.parametrize(('angle', 'start'), [(26, 3.0), (-26, 1.8)])
def test_slope_ahead_over_another_plane(angle, start):
    assert apart_deg(vertical(bank(angle, start), ground=LEANING), EYE.up) < 2


@pytest.mark.parametrize(('angle', 'start'), [(26, 3.0), (-26, 1.8)])
def test_slope_ahead_of_a_slope_that_the_rover_stands_on(angle, start):
    height = together(tilted(0.1, 0.1), bank(angle, start))
    normal = np.array([-0.1, -0.1, 1]) @ EYE.axes
    assert apart_deg(vertical(height), normal / np.linalg.norm(normal)) < 2


def test_rocks_do_not_matter():
    generator = np.random.default_rng(1)
    places = zip(
        generator.uniform(-1.5, 1.5, 12), generator.uniform(1, 5, 12),
        generator.uniform(0.2, 0.5, 12), generator.uniform(0.1, 0.4, 12), strict=True,
    )  # fmt: skip
    rocks = together(*(block(*place) for place in places))
    assert apart_deg(vertical(rocks), EYE.up) < 0.5
    assert apart_deg(vertical(together(rocks, bank(26, 3.5))), EYE.up) < 2


def test_gentle_swell_does_not_matter_much():
    def swell(x, y):
        return 0.04 * np.sin(2 * np.pi * x / 3 + 1) * np.sin(2 * np.pi * y / 3)

    assert apart_deg(vertical(swell), EYE.up) < 1.5


def test_noise_does_not_matter():
    disparity, _, _ = EYE.look(bank(26, 3.0))
    noise = np.random.default_rng(0).normal(0, 0.1, disparity.shape)
    noisy = np.where(disparity > 0, np.maximum(disparity + noise, 0), 0).astype(np.float32)
    terrain = survey(
        noisy,
        np.full_like(noisy, 0.1),
        EYE.expected(),
        EYE.camera,
        EYE.level_ground,
        DetectorConfig(),
    )
    assert apart_deg(estimate_vertical(terrain.layers, EYE.level_ground), EYE.up) < 2


def test_too_little_in_view_leaves_the_plane_its_own():
    assert estimate_vertical((), LEANING) == LEANING.up
    disparity, x, y = EYE.look(flat)
    disparity[np.hypot(x, y - 2) > 0.06] = 0
    assert disparity.any()
    terrain = survey(
        disparity,
        np.full_like(disparity, 0.1),
        EYE.expected(),
        EYE.camera,
        EYE.level_ground,
        DetectorConfig(),
    )
    assert estimate_vertical(terrain.layers, LEANING) == LEANING.up


def test_ground_behind_the_eye_and_far_away_does_not_count():
    # Straight down, half of what is seen lies behind.
    assert estimate_vertical(
        Eye(pitch_deg=90.0).survey(flat)[0].layers, Eye(pitch_deg=90.0).level_ground
    ) == pytest.approx(Eye(pitch_deg=90.0).up, abs=1e-3)
    low = Eye(pitch_deg=5.0)
    assert apart_deg(vertical(bank(3, 12.0), low), low.up) < 0.3


def test_same_terrain_gives_the_same_vertical():
    assert vertical(bank(26, 3.0)) == vertical(bank(26, 3.0))
