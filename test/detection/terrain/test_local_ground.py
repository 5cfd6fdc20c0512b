from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.terrain.local_ground import local_ground, smoothed
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.viewpoint import Viewpoint

CELL_M = 0.04
SHAPE = (90, 100)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]


def local(height, weight=None, distance_noise=0.0, camera_row=-30.0, **parameters):
    height = np.asarray(height, np.float32)
    weight = np.ones_like(height) if weight is None else np.asarray(weight, np.float32)
    noise = np.full_like(height, distance_noise)
    viewpoint = Viewpoint(1.2, 50.0, camera_row, noise, 0.3)
    found = local_ground(height, weight, CELL_M, viewpoint, TerrainParameters(**parameters))
    assert ((found.trust == weight) | (found.trust == 0)).all()
    assert found.height_m.dtype == np.float32
    return found


def ground_under(height, weight=None):
    return local(height, weight).height_m


def seen_weight(share=0.7, seed=1):
    """Weight of a map with empty cells, the others unevenly trusted."""
    generator = np.random.default_rng(seed)
    return np.where(generator.random(SHAPE) < share, generator.uniform(0.2, 5, SHAPE), 0)


def test_flat_ground_is_flat():
    np.testing.assert_allclose(ground_under(np.zeros(SHAPE)), 0, atol=1e-6)
    np.testing.assert_allclose(ground_under(np.full(SHAPE, 0.2)), 0.2, atol=1e-3)


@pytest.mark.parametrize('rise', [-0.3, -0.1, 0.1, 0.3])
@pytest.mark.parametrize('along', ['rows', 'columns'])
def test_ground_follows_a_slope_to_the_edge(rise, along):
    ramp = rise * CELL_M * (ROWS if along == 'rows' else COLUMNS)
    found = ground_under(ramp)
    np.testing.assert_allclose(found[5:-5, 5:-5], ramp[5:-5, 5:-5], atol=0.01)
    np.testing.assert_allclose(found, ramp, atol=0.02)


def test_rock_and_its_foot_are_not_trusted_as_ground():
    terrain = np.zeros(SHAPE)
    terrain[40:50, 40:50] = 0.3
    trust = local(terrain).trust
    rock = np.zeros(SHAPE, bool)
    rock[39:51, 39:51] = True
    np.testing.assert_array_equal(trust == 0, rock)


def test_rock_and_its_foot_are_not_bare():
    terrain = np.zeros(SHAPE)
    terrain[40:50, 40:50] = 0.3
    rock = np.zeros(SHAPE, bool)
    rock[39:51, 39:51] = True
    np.testing.assert_array_equal(~local(terrain).is_bare, rock)


@pytest.mark.parametrize('rise_m', [-0.16, 0.16])
def test_the_face_of_a_ledge_is_bare_although_it_is_no_ground(rise_m):
    terrain = rise_m * np.clip((ROWS - 43) / 3, 0, 1)
    found = local(terrain)
    assert (found.trust == 0).all(axis=1).sum() == 3
    assert found.is_bare.all()


def test_a_wall_is_not_bare_however_wide():
    is_bare = local(0.6 * np.clip((ROWS - 43) / 4, 0, 1)).is_bare
    assert is_bare[:44].all()
    assert not is_bare[44:49].any()
    assert local(0.3 * np.clip((ROWS - 43) / 3, 0, 1)).is_bare.all(), 'half as high, a ledge'


def test_a_strip_wider_than_the_opening_is_bare_also_where_it_is_turned():
    across_m = np.abs((ROWS - 45) - (COLUMNS - 50)) / 2**0.5 * CELL_M
    assert local(np.where(across_m < 0.4, 0.09, 0.0)).is_bare.all()


@pytest.mark.parametrize('radius_cells', [8, 14])
def test_discs_one_after_the_other_keep_and_remove_what_one_does(radius_cells):
    # The opening is 17 cells wide: at once, or by discs of half as many.
    disc = np.hypot(ROWS - 45, COLUMNS - 50) < radius_cells
    for most in (17, 9):
        is_bare = local(np.where(disc, 0.09, 0.0), disc_cells=most).is_bare
        assert is_bare.all() == (radius_cells == 14)


def test_a_rock_that_touches_a_ledge_is_not_bare():
    terrain = 0.3 * np.clip((ROWS - 49) / 3, 0, 1)
    terrain[38:50, 45:55] = 0.09
    is_bare = local(terrain).is_bare
    assert not is_bare[38:46, 45:55].any()
    assert is_bare[50:].all()


def test_the_outline_of_a_ledge_is_bare_and_a_rock_before_it_is_not():
    # Turned against the axes, with dents.
    edge = 60 - 0.7 * COLUMNS + 2 * (COLUMNS // 3 % 2)
    terrain = np.where(edge > ROWS, 0.0, 0.08)
    rock = np.s_[16:24, 10:18]
    terrain[rock] = 0.3
    is_bare = local(terrain).is_bare
    assert not is_bare[rock].any()
    is_bare[15:25, 9:19] = True
    assert is_bare.all()


@pytest.mark.parametrize(('size_m', 'height'), [(0.2, 0.15), (0.4, 0.3), (0.6, 0.5)])
def test_rock_does_not_raise_the_ground(size_m, height):
    half = round(size_m / CELL_M / 2)
    terrain = np.zeros(SHAPE)
    terrain[45 - half : 45 + half, 50 - half : 50 + half] = height
    np.testing.assert_allclose(ground_under(terrain), 0, atol=0.015)


def test_rock_that_hides_all_behind_it_does_not_raise_the_ground():
    terrain = np.zeros(SHAPE)
    terrain[40:46, 20:80] = 0.3
    weight = np.where(ROWS < 46, 1.0, 0.0)
    found = ground_under(terrain, weight)
    np.testing.assert_allclose(found[:46], 0, atol=0.03)


def test_rock_on_a_slope_does_not_raise_the_ground():
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


def test_values_of_empty_cells_do_not_matter():
    weight = seen_weight()
    clean = np.where(weight > 0, 0.05, 0)
    dirty = np.where(weight > 0, 0.05, 9.0)
    np.testing.assert_allclose(ground_under(dirty, weight), ground_under(clean, weight), atol=1e-4)


def test_noise_is_averaged():
    noise = np.random.default_rng(4).normal(0, 0.01, SHAPE)
    assert np.abs(ground_under(noise)).mean() < 0.008


@pytest.mark.parametrize('distance_noise', [0.0, 0.02])
def test_noisy_bank_far_away_is_ground_if_the_noise_is_known(distance_noise):
    # Level ground beyond a fall, over the plane of the fall: the camera looks along the plane.
    bank = 0.5 * CELL_M * ROWS
    noise = np.random.default_rng(3).normal(0, 0.08, SHAPE)
    trust = local(bank + noise, None, distance_noise, camera_row=-500.0).trust
    # The camera is 11 m above the bank: 2 % of the distance are 0.2 m of height.
    assert ((trust > 0).mean() > 0.9) == (distance_noise > 0)


def test_unseen_ground_is_flat():
    np.testing.assert_allclose(ground_under(np.zeros(SHAPE), np.zeros(SHAPE)), 0, atol=1e-6)


@pytest.mark.parametrize('shape', [(1, 1), (2, 30), (30, 2)])
def test_tiny_maps_have_ground(shape):
    np.testing.assert_allclose(ground_under(np.full(shape, 0.1)), np.full(shape, 0.1), atol=0.01)


def test_smoothing_counts_the_outside_as_zero():
    found = smoothed(np.ones((41, 41), np.float32), 3.0)
    assert found[20, 20] == pytest.approx(1, abs=1e-3)
    assert found[20, 0] == pytest.approx(0.566, abs=0.02)
    assert found[0, 0] == pytest.approx(0.566**2, abs=0.02)
