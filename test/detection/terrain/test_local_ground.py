from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.terrain.local_ground import local_ground, smoothed
from rover_obstacle_detection.detection.terrain.viewpoint import Sight

CELL_M = 0.04
SHAPE = (90, 100)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
SCALES = {'opening_m': 0.8, 'trend_m': 0.4, 'smoothing_m': 0.08, 'tolerance_m': 0.05}


def sight(share=0.0, row=-30.0, shape=SHAPE):
    return Sight(1.2, 50.0, row, np.full(shape, share, np.float32))


def ground_under(height, weight=None):
    weight = np.ones(SHAPE) if weight is None else weight
    weight = np.asarray(weight, np.float32)
    ground = local_ground(np.asarray(height, np.float32), weight, CELL_M, **SCALES, sight=sight())
    found, trust = ground.height_m, ground.trust
    assert ((trust == weight) | (trust == 0)).all()
    assert found.dtype == np.float32
    assert found.shape == SHAPE
    assert np.isfinite(found).all()
    return found


def seen_weight(share=0.7, seed=1):
    """Some cells empty, the others of uneven trust."""
    generator = np.random.default_rng(seed)
    return np.where(generator.random(SHAPE) < share, generator.uniform(0.2, 5, SHAPE), 0)


def test_flat_ground_is_flat():
    np.testing.assert_allclose(ground_under(np.zeros(SHAPE)), 0, atol=1e-6)
    np.testing.assert_allclose(ground_under(np.full(SHAPE, 0.2)), 0.2, atol=1e-3)


@pytest.mark.parametrize('rise', [-0.3, -0.1, 0.1, 0.3])
@pytest.mark.parametrize('along', ['rows', 'columns'])
def test_slope_is_followed_to_the_edge(rise, along):
    ramp = rise * CELL_M * (ROWS if along == 'rows' else COLUMNS)
    found = ground_under(ramp)
    np.testing.assert_allclose(found[5:-5, 5:-5], ramp[5:-5, 5:-5], atol=0.01)
    np.testing.assert_allclose(found, ramp, atol=0.02)


def test_ground_is_told_from_what_stands_on_it_and_its_foot():
    terrain = np.zeros(SHAPE)
    terrain[40:50, 40:50] = 0.3
    weight = np.ones(SHAPE, np.float32)
    trust = local_ground(terrain.astype(np.float32), weight, CELL_M, **SCALES, sight=sight()).trust
    assert not trust[39:51, 39:51].any()
    assert trust[:37].all()
    assert trust[53:].all()


@pytest.mark.parametrize(('size_m', 'height'), [(0.2, 0.15), (0.4, 0.3), (0.6, 0.5)])
def test_rock_is_not_part_of_the_ground_under_it(size_m, height):
    half = round(size_m / CELL_M / 2)
    terrain = np.zeros(SHAPE)
    terrain[45 - half : 45 + half, 50 - half : 50 + half] = height
    np.testing.assert_allclose(ground_under(terrain), 0, atol=0.015)


def test_rock_that_hides_all_behind_it_is_no_ground():
    # From low down little is seen behind what stands up.
    terrain = np.zeros(SHAPE)
    terrain[40:46, 20:80] = 0.3
    weight = np.where(ROWS < 46, 1.0, 0.0)
    found = ground_under(terrain, weight)
    np.testing.assert_allclose(found[:46], 0, atol=0.03)


def test_rock_on_a_slope():
    ramp = 0.2 * CELL_M * ROWS
    terrain = ramp.copy()
    terrain[40:48, 46:54] += 0.25
    np.testing.assert_allclose(ground_under(terrain), ramp, atol=0.025)


def test_gentle_swell_is_ground():
    swell = 0.15 * np.sin(ROWS * CELL_M * 2 * np.pi / 2.5)
    np.testing.assert_allclose(ground_under(swell)[5:-5], swell[5:-5], atol=0.03)


def test_hollow_is_ground():
    hollow = np.zeros(SHAPE)
    hollow[30:60, 35:65] = -0.3
    found = ground_under(hollow)
    np.testing.assert_allclose(found[36:54, 41:59], -0.3, atol=0.05)


def test_empty_cells_take_the_trend_around_them():
    ramp = 0.2 * CELL_M * COLUMNS
    weight = seen_weight()
    weight[30:60, 40:60] = 0
    found = ground_under(np.where(weight > 0, ramp, 0), weight)
    np.testing.assert_allclose(found[5:-5, 5:-5], ramp[5:-5, 5:-5], atol=0.015)


def test_what_empty_cells_hold_does_not_matter():
    weight = seen_weight()
    clean = np.where(weight > 0, 0.05, 0)
    dirty = np.where(weight > 0, 0.05, 9.0)
    np.testing.assert_allclose(ground_under(dirty, weight), ground_under(clean, weight), atol=1e-4)


def test_noise_is_averaged():
    noise = np.random.default_rng(4).normal(0, 0.01, SHAPE)
    assert np.abs(ground_under(noise)).mean() < 0.008


@pytest.mark.parametrize('share', [0.0, 0.02])
def test_noise_of_a_bank_far_away_takes_no_ground_from_it(share):
    # Level ground beyond a fall, over the plane of the fall: the eye looks along the plane.
    bank = 0.5 * CELL_M * ROWS
    noise = np.random.default_rng(3).normal(0, 0.08, SHAPE)
    height = np.asarray(bank + noise, np.float32)
    weight = np.ones(SHAPE, np.float32)
    trust = local_ground(height, weight, CELL_M, **SCALES, sight=sight(share, -500.0)).trust
    # The eye is 11 m over the bank, so that 2 % of the distance are 0.2 m of height.
    assert ((trust > 0).mean() > 0.9) == (share > 0)


def test_nothing_seen_is_flat():
    np.testing.assert_allclose(ground_under(np.zeros(SHAPE), np.zeros(SHAPE)), 0, atol=1e-6)


@pytest.mark.parametrize('shape', [(1, 1), (2, 30), (30, 2)])
def test_tiny_maps(shape):
    found = local_ground(
        np.full(shape, 0.1, np.float32),
        np.ones(shape, np.float32),
        CELL_M,
        **SCALES,
        sight=sight(0.01, shape=shape),
    ).height_m
    assert found.shape == shape
    np.testing.assert_allclose(found, 0.1, atol=0.01)


def test_smoothing_takes_the_outside_for_empty():
    found = smoothed(np.ones((41, 41), np.float32), 3.0)
    assert found[20, 20] == pytest.approx(1, abs=1e-3)
    assert found[20, 0] == pytest.approx(0.566, abs=0.02)
    assert found[0, 0] == pytest.approx(0.566**2, abs=0.02)
