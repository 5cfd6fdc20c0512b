from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.simulation.description import Crater, TerrainParameters
from rover_obstacle_detection.simulation.noise import Tile, fractal_tile, solid_noise
from rover_obstacle_detection.simulation.terrain import Apron, Terrain

FLAT = {'relief_m': 0.0, 'roughness_m': 0.0, 'clods_m': 0.0, 'hills_m': 0.0}


def grid(low, high, step=0.1):
    axis = np.arange(low, high, step, dtype=np.float32)
    return np.meshgrid(axis, axis)


def test_tile_is_periodic_with_unit_rms():
    tile = fractal_tile(np.random.default_rng(1), 4.0, 1.0, 0.1, size=128)
    x, y = grid(0.0, 4.0)
    here = tile.smooth(x, y)
    # The period is along the rotated axes of the tile.
    cosine, sine = np.cos(tile.rotation_rad), np.sin(tile.rotation_rad)
    there = tile.smooth((x + 4.0 * cosine).astype(np.float32), (y + 4.0 * sine).astype(np.float32))
    np.testing.assert_allclose(there, here, atol=2e-4)
    assert tile.values.std() == pytest.approx(1.0, abs=1e-5)
    assert abs(tile.values.mean()) < 1e-5


def test_linear_interpolation_of_a_tile():
    values = np.arange(16, dtype=np.float32).reshape(4, 4)
    tile = Tile(values, period_m=4.0)
    x, y = np.array([0, 1, 2.5, 3.5], np.float32), np.array([0, 2, 1, 0], np.float32)
    np.testing.assert_allclose(tile.linear(x, y), [0, 9, 6.5, 1.5])


def test_cubic_interpolation_has_no_kinks():
    tile = fractal_tile(np.random.default_rng(2), 1.0, 0.5, 0.05, size=32)
    x = np.linspace(0, 1, 20001, dtype=np.float32)
    slope = np.gradient(tile.smooth(x, np.zeros_like(x)).astype(np.float64), x[1] - x[0])
    smoothed = np.convolve(slope, np.ones(40) / 40, 'valid')
    # The slope of a linear interpolation would jump at the samples.
    assert np.abs(np.diff(smoothed)).max() < 0.02 * np.abs(slope).max()


def test_solid_noise_is_periodic():
    noise = solid_noise(np.random.default_rng(3), size=16)
    points = np.random.default_rng(4).uniform(-1, 1, (50, 3)).astype(np.float32)
    np.testing.assert_allclose(noise.read(points + 1), noise.read(points), atol=1e-4)


def test_terrain_has_height_zero_at_the_start():
    origin = np.zeros(1, np.float32)
    for seed in range(3):
        terrain = Terrain(TerrainParameters(relief_m=0.1), seed)
        assert terrain.height(origin, origin)[0] == pytest.approx(0.0, abs=1e-6)


def test_equal_seeds_give_equal_terrain():
    x, y = grid(-3, 3)
    parameters = TerrainParameters()
    first = Terrain(parameters, 5).height(x, y)
    np.testing.assert_array_equal(first, Terrain(parameters, 5).height(x, y))
    assert np.abs(first - Terrain(parameters, 6).height(x, y)).max() > 0.01


@pytest.mark.parametrize('slope_deg', [12.0, -26.0])
def test_ramp_has_the_requested_slope_and_ends(slope_deg):
    terrain = Terrain(
        TerrainParameters(**FLAT, slope_deg=slope_deg, slope_start_m=2.0, slope_length_m=6.0), 1
    )
    x = np.array([-3.0, 4.0, 5.0, 12.0, 13.0], np.float32)
    z = terrain.height(x, np.zeros_like(x))
    rise = np.tan(np.radians(slope_deg))
    assert z[2] - z[1] == pytest.approx(rise, rel=1e-2)
    assert z[0] == pytest.approx(0.0, abs=1e-3)
    assert z[4] == pytest.approx(6.0 * rise, rel=1e-2)


def test_crater_has_the_requested_depth_and_a_rim():
    crater = Crater(ahead_m=3.0, left_m=1.0, diameter_m=2.0, depth_m=0.4)
    terrain = Terrain(TerrainParameters(**FLAT, craters=(crater,)), 1)
    x = np.array([3.0, 4.05, 3.0], np.float32)
    y = np.array([1.0, 1.0, -4.0], np.float32)
    centre, rim, plain = terrain.height(x, y)
    assert centre - plain == pytest.approx(-0.4, abs=0.01)
    assert 0.0 < rim - plain < 0.1


def test_dunes_have_the_requested_height():
    terrain = Terrain(TerrainParameters(**FLAT, dune_height_m=0.4, dune_length_m=5.0), 2)
    z = terrain.height(*grid(-20, 20, 0.25))
    assert np.ptp(z) == pytest.approx(0.4, rel=0.05)


def test_heaped_soil_has_the_requested_shape():
    terrain = Terrain(TerrainParameters(**FLAT), 1)
    terrain.heap([Apron(1.0, -0.5, radius_m=0.3, height_m=0.05)])
    x = np.array([1.0, 1.3, 4.0], np.float32)
    y = np.array([-0.5, -0.5, -0.5], np.float32)
    top, side, far = terrain.height(x, y)
    assert top == pytest.approx(0.05, rel=0.03)
    assert side == pytest.approx(0.05 * np.exp(-1), rel=0.05)
    assert far == 0.0
    terrain.heap([])
    assert terrain.height(x, y)[0] == 0.0
