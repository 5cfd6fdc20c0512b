from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import waves

from rover_obstacle_detection.detection.images.brightness import Spread, grey_level_shares
from rover_obstacle_detection.detection.images.contrast import tone_curve, with_even_contrast
from rover_obstacle_detection.detection.images.image_noise import image_gradient
from rover_obstacle_detection.detection.images.parameters import ImageParameters

PARAMETERS = ImageParameters()
ROWS, COLUMNS = np.mgrid[:150, :200]
NO_NOISE = np.zeros(256, np.float32)


def shaded(light):
    """Textured ground whose first columns get a share of the light."""
    grey = 90 + 0.4 * (waves.texture(COLUMNS, ROWS) - 128)
    return waves.as_image(np.where(COLUMNS < 60, light, 1.0) * grey)


def even(image, noise_gradient=NO_NOISE):
    gradient = image_gradient(image, PARAMETERS)
    return with_even_contrast((image, image), gradient, noise_gradient, PARAMETERS)[0]


def contrast(image):
    return np.diff(image.astype(float), axis=1).std()


def test_shadow_gets_the_contrast_of_the_light():
    image = shaded(0.3)
    found = even(image)
    assert found.dtype == np.uint8
    before = contrast(image[:, :50]) / contrast(image[:, 70:])
    after = contrast(found[:, :50]) / contrast(found[:, 70:])
    assert before == pytest.approx(0.3, abs=0.03)
    # The contrast of the whole image, which the shadow lowers, and less what counts as even.
    assert 0.55 < after < 1 / PARAMETERS.even_contrast_ratio


def test_deep_shadow_is_raised_no_further_than_allowed():
    image = shaded(0.1)
    gain = contrast(even(image)[:, :50]) / contrast(image[:, :50])
    assert gain == pytest.approx(PARAMETERS.max_shadow_gain, rel=0.15)


def test_even_light_stays_as_it_is():
    image = shaded(1.0)
    assert even(image) is image


def test_black_sky_does_not_make_shadow_light():
    image = shaded(0.3)
    image[:90] = 0
    found = even(image)
    assert not found[:80].any()
    assert contrast(found[100:, :50]) > 1.5 * contrast(image[100:, :50])


def test_dull_ground_in_full_light_is_no_shadow():
    grey = np.where(COLUMNS < 60, 0.2, 1.0) * (waves.texture(COLUMNS, ROWS) - 128)
    image = waves.as_image(90 + 0.4 * grey)
    assert even(image) is image


def curve(shares, by_brightness, noise_gradient=0.0, **parameters):
    gradient = Spread(5.0, np.asarray(by_brightness, np.float32))
    noise = NO_NOISE + np.float32(noise_gradient)
    return tone_curve(shares, gradient, noise, replace(PARAMETERS, **parameters))


SHADOW = np.where(np.arange(256) < 30, 1.0, 5.0)
HALF_DARK = grey_level_shares(np.repeat(np.uint8([20, 120, 120]), 10).reshape(3, 10), PARAMETERS)


def test_curve_rises_and_keeps_black():
    found = curve(HALF_DARK, SHADOW)
    assert found.dtype == np.uint8
    assert found[0] == 0
    assert (np.diff(found.astype(int)) >= 0).all()
    # Up to the shadow's limit, four times the contrast; then as before.
    assert found[20] == 80
    assert found[121] - found[120] == 1


def test_noise_alone_is_not_raised():
    assert curve(HALF_DARK, SHADOW, noise_gradient=0.7) is not None
    assert curve(HALF_DARK, SHADOW, noise_gradient=0.95) is None


def test_curve_keeps_what_is_bright_below_white():
    shares = grey_level_shares(np.repeat(np.uint8([20, 120, 220]), 10).reshape(3, 10), PARAMETERS)
    found = curve(shares, SHADOW)
    assert found[220] == 255
    assert found[120] < found[220]
    assert found[20] > 20


def test_shadow_is_relative_to_the_brightness_of_the_image():
    bright = grey_level_shares(np.full((4, 4), 80, np.uint8), PARAMETERS)
    found = curve(bright, np.where(np.arange(256) < 60, 1.0, 5.0))
    gains = np.diff(found.astype(int))
    assert (gains[1:38] == 4).all()
    assert (gains[41:] <= 1).all()


def test_contrast_near_that_of_the_image_is_left():
    slight = np.where(np.arange(256) < 30, 4.1, 5.0)
    assert curve(HALF_DARK, slight) is None
    assert curve(HALF_DARK, slight, even_contrast_ratio=1.0) is not None


def test_only_black_is_empty_afterwards():
    shares = np.zeros(256, np.float32)
    shares[[100, 240]] = 0.5
    found = curve(
        shares, np.where(np.arange(256) < 10, 5.0, np.where(np.arange(256) < 50, 0.5, 5))
    )
    assert found[0] == 0
    assert found[1] == 1


@pytest.mark.parametrize('level', [0, 255])
def test_plain_images_are_left(level):
    image = np.full((40, 50), level, np.uint8)
    assert even(image) is image
