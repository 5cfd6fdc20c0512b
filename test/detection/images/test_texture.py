from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.images.texture import texture_level, untextured

PARAMETERS = ImageParameters()


def test_smooth_images_have_the_smallest_texture():
    assert texture_level(np.full((40, 50), 90, np.uint8), PARAMETERS) == 1.0
    ramp = np.tile(np.arange(50, dtype=np.uint8), (40, 1))
    assert texture_level(ramp, PARAMETERS) == 1.0


@pytest.mark.parametrize('sigma', [5.0, 12.0])
def test_texture_is_the_standard_deviation_of_noise(sigma):
    noise = np.random.default_rng(3).normal(128, sigma, (120, 160))
    level = texture_level(np.rint(noise).astype(np.uint8), PARAMETERS)
    assert level == pytest.approx(sigma, rel=0.05)


def test_an_outline_is_not_texture():
    noise = np.random.default_rng(3).normal(0, 4, (120, 160))
    noise[:, :80] += 60
    noise[:, 80:] += 190
    level = texture_level(np.rint(noise).astype(np.uint8), PARAMETERS)
    assert level == pytest.approx(4, rel=0.15)


def test_noisy_sky_is_untextured_and_ground_is_not():
    random = np.random.default_rng(3)
    image = random.normal(200, 1.0, (60, 80))
    image[30:] = random.normal(120, 8.0, (30, 80))
    bare = untextured(np.clip(image, 0, 255).astype(np.uint8), 9, 2.0)
    assert bare[:24].mean() > 0.99
    assert not bare[36:].any()


def test_vertical_stripes_are_texture_and_horizontal_ones_are_not():
    stripes = np.tile(np.arange(40, dtype=np.uint8) // 2 % 2 * 40, (30, 1))
    assert not untextured(stripes, 9, 2.0)[:, 6:-6].any()
    assert untextured(np.ascontiguousarray(stripes.T), 9, 2.0).all()


def test_texture_of_a_small_image_is_that_of_all_its_pixels():
    signs = np.random.default_rng(0).choice([-1, 1], (60, 80))
    grey = (100 + 20 * signs).astype(np.uint8)
    grey[::2, ::2] = 100
    assert texture_level(grey, PARAMETERS) == pytest.approx(1.4826 * 20, rel=0.1)


def test_difference_counts_between_both_neighbours_of_a_pixel():
    ramp = np.tile(np.arange(40, dtype=np.uint8), (30, 1))
    inner = np.s_[:, 6:-6]
    assert not untextured(ramp, 9, 2.0)[inner].any()
    assert untextured(ramp, 9, 2.1)[inner].all()
