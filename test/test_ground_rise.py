from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from relief import Eye, bank, flat

from rover_obstacle_detection.detection.relief import ground_height, ground_rise

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
    np.testing.assert_allclose(noisier_m[inner], 10 * noise_m[inner], rtol=0.05)
