from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.simulation.description import LightParameters, SensorParameters
from rover_obstacle_detection.simulation.sensor import automatic_exposure, develop
from rover_obstacle_detection.simulation.sky import make_light, through_haze

IDEAL = SensorParameters(blur_px=0.0, vignetting=0.0, full_well=1e6, read_noise=0.0)
GAMMA = 2.2


def grey(value, height=60, width=80):
    return np.full((height, width, 3), value, np.float32)


def image_of(radiance, seed=1, gain=1.0, colour=False, **changes):
    parameters = dataclasses.replace(IDEAL, **changes)
    rng = np.random.default_rng(seed)
    return develop(radiance, parameters, 1.0, rng, gain=gain, colour=colour)


def linear(image, bits=8):
    return (image.astype(np.float64) / ((1 << bits) - 1)) ** GAMMA


def test_ideal_sensor_reproduces_the_light():
    image = image_of(grey(0.25))
    assert image.dtype == np.uint8
    np.testing.assert_allclose(linear(image), 0.25, atol=0.005)


def test_shot_and_read_noise():
    image = image_of(grey(0.3), bits=16, full_well=2000.0, read_noise=15.0)
    spread = linear(image, 16).std() * 2000.0
    assert spread == pytest.approx(math.sqrt(0.3 * 2000 + 15**2), rel=0.05)


def test_bit_depth():
    image = image_of(grey(2.0), bits=12)
    assert image.dtype == np.uint16
    assert image.max() == 4095


def test_saturation_applies_to_luminance():
    red = grey(0.0)
    red[..., 0] = 1.5
    assert (image_of(grey(0.5), exposure=3.0) == 255).mean() > 0.99
    # Clipping the channels first would limit pure red to 0.2126.
    np.testing.assert_allclose(linear(image_of(red)), 1.5 * 0.2126, atol=0.006)


def test_gain_scales_the_light():
    ratio = linear(image_of(grey(0.4), gain=0.65)).mean() / linear(image_of(grey(0.4))).mean()
    assert ratio == pytest.approx(0.65, abs=0.01)


def test_colour_keeps_the_channels():
    light = grey(0.0)
    light[...] = 0.6, 0.3, 0.1
    image = image_of(light, colour=True)
    assert image.shape == (60, 80, 3)
    np.testing.assert_allclose(linear(image).mean((0, 1)), [0.6, 0.3, 0.1], atol=0.01)


def test_vignetting_darkens_the_corners():
    image = linear(image_of(grey(0.5), vignetting=0.4, bits=16), 16)
    assert image[30, 40] == pytest.approx(0.5, rel=0.02)
    assert image[0, 0] == pytest.approx(0.3, rel=0.03)


def test_motion_blur_acts_along_its_direction():
    light = grey(0.0)
    light[30, 40] = 1.0
    image = linear(image_of(light, bits=16, motion_blur_px=7.0, motion_blur_deg=0.0), 16)
    assert (image[30] > 0.02).sum() >= 7
    assert (image[:, 40] > 0.02).sum() <= 2
    assert image.sum() == pytest.approx(1.0, rel=0.05)


def test_dust_darkens_and_differs_between_lenses():
    clean = linear(image_of(grey(0.5)))
    left = linear(image_of(grey(0.5), seed=1, dust_spots=10))
    right = linear(image_of(grey(0.5), seed=2, dust_spots=10))
    assert left.max() <= clean.max() + 0.01
    assert left.min() < 0.45
    assert np.corrcoef(left.ravel(), right.ravel())[0, 1] < 0.5


def test_glare_brightens_dark_areas():
    light = grey(0.0)
    light[:, :40] = 0.8
    assert linear(image_of(light, glare=0.1))[:, 60].mean() == pytest.approx(0.04, abs=0.01)


def test_automatic_exposure_ignores_the_sky():
    light = grey(0.2)
    light[:20] = 50.0
    on_surface = np.ones(light.shape[:2], bool)
    on_surface[:20] = False
    exposure = automatic_exposure(light, on_surface)
    assert 0.2 < exposure * 0.2 < 0.7


def test_equal_seeds_give_equal_images():
    noisy = {'full_well': 1000.0, 'dust_spots': 3}
    np.testing.assert_array_equal(
        image_of(grey(0.3), seed=4, **noisy), image_of(grey(0.3), seed=4, **noisy)
    )
    assert (image_of(grey(0.3), seed=4, **noisy) != image_of(grey(0.3), seed=5, **noisy)).any()


def sky_on_level_ground(sky):
    rows, columns = sky.shape[:2]
    elevation = np.pi / 2 - (np.arange(rows) + 0.5) * np.pi / rows
    weight = np.maximum(np.sin(elevation), 0) * np.cos(elevation)
    return (sky.mean(2).sum(1) * weight).sum() * np.pi / rows * 2 * np.pi / columns


def test_skylight_has_the_requested_irradiance():
    noon = make_light(LightParameters(sun_elevation_deg=90.0, sky=0.5), 'mars')
    ratio = sky_on_level_ground(noon.sky) / noon.sun_irradiance.max()
    assert ratio == pytest.approx(0.5, rel=0.01)


def test_sky_is_brightest_around_the_sun():
    light = make_light(LightParameters(sun_elevation_deg=30.0, sun_azimuth_deg=90.0), 'mars')
    row, column = np.unravel_index(light.sky.mean(2).argmax(), light.sky.shape[:2])
    elevation = 90 - (row + 0.5) * 180 / light.sky.shape[0]
    azimuth = (column + 0.5) * 360 / light.sky.shape[1]
    assert elevation == pytest.approx(30, abs=5)
    assert azimuth == pytest.approx(90, abs=5)
    np.testing.assert_allclose(light.sun_direction, [0, math.sqrt(3) / 2, 0.5], atol=1e-12)


def test_low_sun_is_redder():
    low = make_light(LightParameters(sun_elevation_deg=8.0), 'mars').sun_irradiance
    high = make_light(LightParameters(sun_elevation_deg=80.0), 'mars').sun_irradiance
    assert low[0] / low[2] > 1.1 * high[0] / high[2]


def test_moon_has_no_sky():
    assert make_light(LightParameters(), 'moon').sky is None


def test_haze_affects_distant_surfaces_but_not_the_sky():
    light = make_light(LightParameters(), 'mars')
    depth = np.array([[1.0, 500.0, np.nan]], np.float32)
    seen = through_haze(np.zeros((1, 3, 3), np.float32), depth, light, 500.0)
    horizon = light.sky[62:64].mean((0, 1))
    np.testing.assert_allclose(seen[0, 1], horizon * (1 - math.exp(-1)), rtol=1e-4)
    assert seen[0, 0].max() < 0.01 * horizon.max()
    assert (seen[0, 2] == 0).all()


def test_gamma_shapes_the_tone_curve():
    image = image_of(grey(0.25), gamma=1.0)
    assert image.mean() == pytest.approx(0.25 * 255, abs=0.6)


def test_sharpening_overshoots_at_edges():
    edge = grey(0.2)
    edge[:, 40:] = 0.5
    plain, sharp = image_of(edge), image_of(edge, sharpening=1.0)
    assert sharp[30, 40] > plain[30, 40] + 8
    assert sharp[30, 39] < plain[30, 39] - 8
    assert abs(int(sharp[30, 5]) - int(plain[30, 5])) <= 1


@pytest.mark.parametrize('colour', [False, True])
def test_jpeg_changes_texture_but_not_colour(colour):
    rng = np.random.default_rng(2)
    texture = rng.uniform(0.1, 0.4, (60, 80, 1)).astype(np.float32) * np.float32([1, 0.6, 0.3])
    plain, packed = (
        image_of(texture, colour=colour, jpeg_quality=quality).astype(np.float64)
        for quality in (0, 60)
    )
    assert packed.shape == plain.shape
    assert np.abs(packed - plain).mean() > 2
    np.testing.assert_allclose(packed.mean((0, 1)), plain.mean((0, 1)), atol=1.5)


def test_jpeg_needs_eight_bits():
    with pytest.raises(ConfigurationError, match='jpeg_quality is 80: expected 0 for 12 bits'):
        SensorParameters(jpeg_quality=80, bits=12)


def test_additional_blur_of_one_camera():
    rng = np.random.default_rng(3)
    texture = np.repeat(rng.uniform(0.1, 0.5, (60, 80, 1)).astype(np.float32), 3, 2)
    plain = develop(texture, IDEAL, 1.0, np.random.default_rng(1))
    blurred = develop(texture, IDEAL, 1.0, np.random.default_rng(1), blur_px=1.0)
    assert blurred.std() < 0.6 * plain.std()
