from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.outline import guided_filter, texture_level, untextured


def test_smooth_images_have_the_least_texture():
    assert texture_level(np.full((40, 50), 90, np.uint8)) == 1.0
    assert texture_level(np.tile(np.arange(50, dtype=np.uint8), (40, 1))) == pytest.approx(1.0)


@pytest.mark.parametrize('sigma', [5.0, 12.0])
def test_texture_is_the_standard_deviation_of_noise(sigma):
    noise = np.random.default_rng(3).normal(128, sigma, (120, 160))
    assert texture_level(np.rint(noise).astype(np.uint8)) == pytest.approx(sigma, rel=0.05)


def test_an_outline_is_no_texture():
    noise = np.random.default_rng(3).normal(0, 4, (120, 160))
    noise[:, :80] += 60
    noise[:, 80:] += 190
    assert texture_level(np.rint(noise).astype(np.uint8)) == pytest.approx(4, rel=0.15)


def test_constant_values_stay():
    guide = np.random.default_rng(1).integers(0, 256, (30, 40), np.uint8)
    result = guided_filter(guide, np.full((30, 40), 0.7, np.float32), 4, 10.0)
    np.testing.assert_allclose(result, 0.7, atol=1e-4)
    assert result.dtype == np.float32


@pytest.mark.parametrize('shift', [1, 2])
def test_values_are_brought_to_the_outline_of_the_guide(shift):
    guide = np.full((60, 60), 60, np.uint8)
    guide[15:45, 15:45] = 180
    values = np.zeros((60, 60), np.float32)
    values[15 + shift : 45 + shift, 15:45] = 1.0
    found = guided_filter(guide, values, 6, 10.0) > 0.5
    wrong_before = np.count_nonzero((values > 0.5) != (guide > 100))
    assert np.count_nonzero(found != (guide > 100)) < 0.2 * wrong_before


def test_without_contrast_values_are_only_smoothed():
    guide = np.full((40, 60), 128, np.uint8)
    values = np.zeros((40, 60), np.float32)
    values[:, 30:] = 1.0
    result = guided_filter(guide, values, 3, 10.0)
    assert (np.diff(result[20]) >= -1e-6).all()
    assert result[20, 10] == pytest.approx(0, abs=1e-6)
    assert result[20, 50] == pytest.approx(1, abs=1e-6)
    assert 0.2 < result[20, 29] < 0.8


def test_bare_sky_is_told_from_ground_by_more_than_its_noise():
    random = np.random.default_rng(3)
    image = random.normal(200, 1.0, (60, 80))
    image[30:] = random.normal(120, 8.0, (30, 80))
    bare = untextured(np.clip(image, 0, 255).astype(np.uint8), 9, 2.0)
    assert bare[:24].mean() > 0.99
    assert not bare[36:].any()


def test_vertical_stripes_are_texture_and_rows_are_not():
    stripes = np.tile(np.arange(40, dtype=np.uint8) // 2 % 2 * 40, (30, 1))
    assert not untextured(stripes, 9, 2.0)[:, 6:-6].any()
    assert untextured(np.ascontiguousarray(stripes.T), 9, 2.0).all()
