from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, bank, flat

from rover_obstacle_detection.detection.terrain.gradient import ground_height, ground_rise

POSED = PosedCamera(pitch_deg=40.0, height_m=1.5)


def nearest_layer(height):
    return POSED.survey(height, noise_px=0.02)[0].layers[0]


def angles_deg(layer):
    """Angle of the rise of each cell, and the noise of the rise."""
    rise = ground_rise(layer, PARAMETERS)
    assert rise.right.dtype == rise.forward.dtype == rise.noise.dtype == np.float32
    return np.degrees(np.arctan(np.hypot(rise.right, rise.forward))), rise.noise


def test_flat_ground_has_no_rise_and_little_noise():
    layer = nearest_layer(flat)
    angle, noise = angles_deg(layer)
    assert angle[layer.seen].max() < 1
    assert np.median(noise[layer.seen]) < math.tan(math.radians(2.5))


@pytest.mark.parametrize('slope', [12, 26])
def test_slope_is_measured_to_the_edge_of_the_seen_ground(slope):
    layer = nearest_layer(bank(slope, 0.0))
    angle, _ = angles_deg(layer)
    well_known = np.median(layer.information[layer.is_bare]) / 9
    inside = layer.is_bare & (layer.information > well_known)
    assert inside.sum() > 1000
    np.testing.assert_allclose(angle[inside], slope, atol=1.5)


def strip_of(width, slope_deg, noise_m):
    """A map that rises forward, of which only a number of columns is seen."""
    layer = nearest_layer(flat)
    rows, columns = np.indices(layer.mean_m.shape)
    seen = (columns >= 20) & (columns < 20 + width)
    rise = math.tan(math.radians(slope_deg)) * layer.positions.cell_m
    return replace(
        layer,
        mean_m=(rise * rows).astype(np.float32),
        information=np.where(seen, 20 / noise_m**2, 0).astype(np.float32),
        is_bare=seen,
        seen=seen,
    )


@pytest.mark.parametrize('width', [3, 5, 7, 20])
@pytest.mark.parametrize('noise_m', [0.002, 0.01, 0.03])
def test_wider_scales_add_no_noise_in_a_narrow_strip(width, noise_m):
    layer = strip_of(width, 26, noise_m)
    angle, noise = angles_deg(layer)
    inside = layer.seen.copy()
    inside[:10] = inside[-10:] = False
    np.testing.assert_allclose(angle[inside], 26, atol=1.5)
    assert noise[inside].max() < math.tan(math.radians(20))


def test_the_many_pixels_of_a_face_do_not_tilt_the_ground_around_it():
    layer = nearest_layer(flat)
    rows, _ = np.indices(layer.mean_m.shape)
    face, cell_m = 30, layer.positions.cell_m
    distance_m = np.abs(rows - face) * cell_m
    seen = np.ones_like(layer.seen)

    def angle_deg(pixels_of_face):
        pixels = np.where(rows == face, pixels_of_face, 10)
        ledge = replace(
            layer,
            mean_m=(0.15 * np.clip(rows - face + 0.5, 0, 1)).astype(np.float32),
            information=(pixels / 0.01**2).astype(np.float32),
            is_bare=seen,
            seen=seen,
        )
        return angles_deg(ledge)[0]

    even, seen_from_below = angle_deg(10), angle_deg(200)
    # A Gaussian of 0.10 m makes the ledge steep up to 0.10 m beside it.
    for angle in (even, seen_from_below):
        assert angle[distance_m < 0.08].min() > 20
        assert angle[(distance_m > 0.17) & (distance_m < 0.5)].max() < 20


def test_noise_of_the_rise_is_that_of_simulated_maps():
    layer = strip_of(40, 0, 0.02)
    random = np.random.default_rng(5)
    pixels = np.exp(random.normal(4.5, 1.0, layer.seen.shape))
    noise_m = 0.02 * np.sqrt(PARAMETERS.shared_pixels / pixels)
    layer = replace(layer, information=np.where(layer.seen, pixels / 0.02**2, 0).astype('f4'))
    rises, noise = [], None
    for _ in range(60):
        mean_m = random.normal(0, noise_m).astype(np.float32)
        rise = ground_rise(replace(layer, mean_m=mean_m), PARAMETERS)
        rises.append((rise.right, rise.forward))
        noise = rise.noise
    inside = layer.seen.copy()
    inside[:15] = inside[-15:] = False
    measured = np.std(rises, axis=0).max(axis=0)[inside]
    assert np.median(measured / noise[inside]) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize('shape', [(1, 1), (1, 40), (40, 1), (3, 3)])
@pytest.mark.parametrize('seen', [False, True])
def test_tiny_and_empty_maps_are_flat(shape, seen):
    zero, mask = np.zeros(shape, np.float32), np.full(shape, seen)
    small = replace(
        nearest_layer(flat),
        is_bare=mask,
        seen=mask,
        information=np.full(shape, 1e5 * seen, np.float32),
        mean_m=zero,
        noise_m=zero,
        ground_m=zero,
    )
    rise, (height_m, noise_m) = ground_rise(small, PARAMETERS), ground_height(small, PARAMETERS)
    for grid in (rise.right, rise.forward, height_m):
        np.testing.assert_allclose(grid, zero, atol=1e-4)
    for grid in (rise.noise, noise_m):
        assert grid.shape == shape
        assert np.isfinite(grid).all()


def test_noise_of_the_height_is_that_of_pixels_to_all_sides():
    layer = nearest_layer(flat)
    stripe = np.zeros((61, 61), np.float32)
    stripe[:, 30] = 1e5

    def noise_m(information):
        same = np.full((61, 61), 0.01, np.float32)
        seen = replace(layer, information=information, noise_m=same, ground_m=same)
        return ground_height(seen, PARAMETERS)[1]

    beside_columns_m, beside_rows_m = noise_m(stripe), noise_m(np.ascontiguousarray(stripe.T))
    assert beside_columns_m[30, 30] < 0.5 * beside_columns_m[30, 20]
    np.testing.assert_allclose(beside_columns_m, beside_rows_m.T, rtol=1e-3)


def even_map(information, ground_m=None):
    """Level ground of 61 by 61 cells of 4 cm, each with the same information."""
    zero, everywhere = np.zeros((61, 61), np.float32), np.ones((61, 61), bool)
    return replace(
        nearest_layer(flat),
        mean_m=zero,
        ground_m=zero if ground_m is None else ground_m,
        noise_m=zero + np.float32(0.01),
        information=zero + np.float32(information),
        is_bare=everywhere,
        seen=everywhere,
    )


def with_scales(*scales_m):
    """Parameters of a rover so low that no scale is too wide for its step."""
    return replace(PARAMETERS, rise_scales_m=scales_m, max_slope_deg=1.0)


@pytest.mark.parametrize(('scale_m', 'cells'), [(0.25, 6.25), (0.1, 2.5), (0.01, 1.0)])
def test_noise_of_the_rise_is_that_of_a_regression_at_least_a_cell_wide(scale_m, cells):
    rise = ground_rise(even_map(1e5), with_scales(scale_m))
    noise = rise.noise[30, 30]
    independent = 2 * math.pi * cells**2 * 1e5 / PARAMETERS.shared_pixels
    assert rise.scale_m[30, 30] == pytest.approx(cells * 0.04)
    assert noise == pytest.approx(1 / (2 * cells * 0.04 * independent**0.5), rel=0.06)


@pytest.mark.parametrize(('scale_m', 'cells'), [(0.1, 2.5), (0.01, 1.0)])
def test_noise_of_the_height_is_that_of_a_mean_and_a_common_part(scale_m, cells):
    _, noise_m = ground_height(even_map(5e4), replace(PARAMETERS, drop_scale_m=scale_m))
    independent = 4 * math.pi * cells**2 * 5e4 / PARAMETERS.shared_pixels
    expected_m = math.hypot(independent**-0.5, PARAMETERS.common_noise_share * 0.01)
    assert noise_m[30, 30] == pytest.approx(expected_m, rel=1e-3)


# The ground itself is a mean at a scale of 0.08 m.
@pytest.mark.parametrize(('scale_m', 'added_m'), [(0.1, 0.06), (0.16, 0.1386), (0.08, 0.024)])
def test_height_is_smoothed_to_the_scale_of_drops(scale_m, added_m):
    peak = np.zeros((61, 61), np.float32)
    peak[30, 30] = 1
    height_m, _ = ground_height(even_map(1e5, peak), replace(PARAMETERS, drop_scale_m=scale_m))
    from_peak_m = (np.arange(61) - 30) * 0.04
    for profile in (height_m.sum(axis=0), height_m.sum(axis=1)):
        spread_m = (profile @ from_peak_m**2 / profile.sum()) ** 0.5
        assert spread_m == pytest.approx(added_m, rel=0.03)


def test_each_scale_takes_over_when_the_one_before_is_too_noisy():
    layer = nearest_layer(flat)
    columns = np.arange(layer.mean_m.shape[1])
    wavy = np.broadcast_to(0.05 * np.sin(columns * 0.2), layer.mean_m.shape).astype(np.float32)
    inside = np.s_[20:-20, 20:-20]
    tolerated = math.tan(math.radians(PARAMETERS.tolerated_rise_noise_deg))
    scales_m = PARAMETERS.rise_scales_m[:3]

    def rise(information, *scales_m):
        noisy = replace(
            layer,
            mean_m=wavy,
            information=np.full_like(wavy, information),
            is_bare=np.ones(wavy.shape, np.bool_),
            seen=np.ones(wavy.shape, np.bool_),
        )
        return ground_rise(noisy, with_scales(*scales_m))

    # The noise goes with the root of the information: twice the tolerated one at the second scale.
    known = rise(1e4, scales_m[1]).noise[inside].mean() ** 2 * 1e4
    information = known / (2 * tolerated) ** 2
    noisy, quiet = (rise(each, *scales_m) for each in (information, 1e8))
    widest = rise(information, scales_m[2]).right[inside]
    np.testing.assert_allclose(noisy.right[inside], widest, atol=0.002)
    np.testing.assert_allclose(noisy.scale_m[inside], scales_m[2], rtol=0.02)
    # Where the noise is little, nothing takes over.
    np.testing.assert_array_equal(quiet.right, rise(1e8, scales_m[0]).right)
    np.testing.assert_allclose(quiet.scale_m, scales_m[0], rtol=1e-6)


@pytest.mark.parametrize(
    ('max_step_m', 'max_slope_deg', 'narrowest_m'),
    [
        (0.1, 20.0, 0.1),
        (0.25, 20.0, 0.1),
        # A ledge of 0.05 m, or of 0.10 m for a limit of 35 degrees, is just as steep as the limit.
        (0.05, 20.0, 0.0548),
        (0.1, 35.0, 0.057),
        (0.1, 0.0, 0.1),
    ],
)
def test_the_narrowest_scale_shows_a_ledge_of_a_step(max_step_m, max_slope_deg, narrowest_m):
    parameters = replace(PARAMETERS, max_step_m=max_step_m, max_slope_deg=max_slope_deg)
    first, *others = parameters.scales_of_rise_m
    assert first == pytest.approx(narrowest_m, abs=1e-4)
    assert tuple(others) == PARAMETERS.rise_scales_m[1:]


def test_noise_widens_the_scale():
    layer = nearest_layer(flat)
    waves = 0.05 * np.sin(np.arange(layer.ground_m.shape[0]) * 0.04 * 2 * np.pi / 0.8)
    wavy = np.broadcast_to(waves[:, np.newaxis], layer.mean_m.shape).astype(np.float32)
    spreads, noises = [], []
    for divisor in (1, 8, 64, 512):
        noisy = replace(layer, mean_m=wavy, information=layer.information / divisor)
        rise = ground_rise(noisy, PARAMETERS)
        spreads.append(rise.forward[20:-20, 20:-20].std())
        noises.append(np.median(rise.noise[layer.is_bare]))
    assert (np.diff(spreads) < 0).all()
    assert spreads[0] > 4 * spreads[-1]
    assert noises == sorted(noises)


def test_height_follows_the_ground_and_its_noise_grows_with_that_of_the_pixels():
    layer = nearest_layer(bank(26, 2.0))
    height_m, noise_m = ground_height(layer, PARAMETERS)
    assert height_m.dtype == noise_m.dtype == np.float32
    inner = layer.is_bare.copy()
    inner[:6] = inner[-6:] = inner[:, :6] = inner[:, -6:] = False
    np.testing.assert_allclose(height_m[inner], layer.ground_m[inner], atol=0.02)
    fewer = replace(layer, information=layer.information / 100)
    _, noisier_m = ground_height(fewer, PARAMETERS)
    assert (noisier_m[inner] > noise_m[inner]).all()
    # Some noise is common to all pixels: averaging does not remove it.
    np.testing.assert_array_less(0.5 * layer.noise_m[inner].min(), noise_m[inner] * 1.001)
