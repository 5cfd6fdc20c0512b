from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.images.texture import texture_level, untextured


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
