from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from relief import Eye, bank, flat

from rover_obstacle_detection.detection.terrain.gradient import ground_height, ground_rise

EYE = Eye(pitch_deg=40.0, height_m=1.5)


def cells_of(height, noise_px=0.02):
    found, *_ = EYE.survey(height, noise_px)
    return found.layers[0]


def angles(layer):
    rise = ground_rise(layer)
    assert rise.right.dtype == rise.forward.dtype == rise.noise.dtype == np.float32
    assert rise.right.shape == layer.ground_m.shape
    return np.degrees(np.arctan(np.hypot(rise.right, rise.forward))), rise.noise


def test_flat_ground_rises_nowhere_and_that_is_known():
    layer = cells_of(flat)
    angle, noise = angles(layer)
    assert angle[layer.seen].max() < 1
    assert np.median(noise[layer.seen]) < math.tan(math.radians(2))


@pytest.mark.parametrize('slope', [12, 26])
def test_slope_is_measured_to_the_edge_of_what_is_seen(slope):
    layer = cells_of(bank(slope, 0.0))
    angle, _ = angles(layer)
    inside = layer.is_ground & (
        layer.information > np.median(layer.information[layer.is_ground]) / 9
    )
    # The plane itself lies level: the bank starts under the rover.
    np.testing.assert_allclose(angle[inside], slope, atol=1.5)


GRIDS = 'mean_m', 'information', 'noise_m', 'ground_m'


def strip_of(width, slope_deg, noise_m):
    """A map of which only so many columns are seen, rising forward."""
    layer = cells_of(flat)
    rows, columns = np.indices(layer.mean_m.shape)
    seen = (columns >= 20) & (columns < 20 + width)
    rise = math.tan(math.radians(slope_deg)) * layer.positions.cell_m
    return replace(
        layer,
        mean_m=(rise * rows).astype(np.float32),
        information=np.where(seen, 20 / noise_m**2, 0).astype(np.float32),
        is_ground=seen,
        seen=seen,
    )


@pytest.mark.parametrize('width', [3, 5, 7, 20])
@pytest.mark.parametrize('noise_m', [0.002, 0.01, 0.03])
def test_a_narrow_strip_is_known_no_worse_by_wider_scales(width, noise_m):
    layer = strip_of(width, 26, noise_m)
    angle, noise = angles(layer)
    inside = layer.seen.copy()
    inside[:10] = inside[-10:] = False
    np.testing.assert_allclose(angle[inside], 26, atol=1.5)
    assert noise[inside].max() < math.tan(math.radians(20))


@pytest.mark.parametrize('shape', [(1, 1), (1, 40), (40, 1), (3, 3)])
def test_tiny_and_empty_maps(shape):
    layer = cells_of(flat)
    grids = {name: np.zeros(shape, np.float32) for name in GRIDS}
    for seen in (False, True):
        mask = np.full(shape, seen)
        small = replace(layer, is_ground=mask, seen=mask, **grids)
        if seen:
            small = replace(small, information=np.full(shape, 1e5, np.float32))
        rise, (height_m, noise_m) = ground_rise(small), ground_height(small)
        for grid in (rise.right, rise.forward, rise.noise, height_m, noise_m):
            assert grid.shape == shape
            assert np.isfinite(grid).all()
        np.testing.assert_allclose(rise.right, 0, atol=1e-4)
        np.testing.assert_allclose(rise.forward, 0, atol=1e-4)


def test_noise_widens_the_scale_that_counts():
    layer = cells_of(flat)
    waves = 0.05 * np.sin(np.arange(layer.ground_m.shape[0]) * 0.04 * 2 * np.pi / 0.8)
    wavy = np.broadcast_to(waves[:, np.newaxis], layer.mean_m.shape).astype(np.float32)
    spreads, noises = [], []
    for divisor in (1, 8, 64, 512):
        noisy = replace(layer, mean_m=wavy, information=layer.information / divisor)
        rise = ground_rise(noisy)
        spreads.append(rise.forward[20:-20, 20:-20].std())
        noises.append(np.median(rise.noise[layer.is_ground]))
    assert (np.diff(spreads) < 0).all()
    assert spreads[0] > 4 * spreads[-1]
    assert noises == sorted(noises)


def test_height_is_smoothed_a_little_and_known_the_less_the_more_noise():
    layer = cells_of(bank(26, 2.0))
    height_m, noise_m = ground_height(layer)
    assert height_m.dtype == noise_m.dtype == np.float32
    inner = layer.is_ground.copy()
    inner[:6] = inner[-6:] = inner[:, :6] = inner[:, -6:] = False
    np.testing.assert_allclose(height_m[inner], layer.ground_m[inner], atol=0.02)
    _, noisier_m = ground_height(replace(layer, information=layer.information / 100))
    assert (noisier_m[inner] > noise_m[inner]).all()
    # However many pixels there are, some of their noise stays.
    np.testing.assert_array_less(0.5 * layer.noise_m[inner].min(), noise_m[inner] * 1.001)
