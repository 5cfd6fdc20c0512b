from __future__ import annotations

import cv2
import numpy as np
import pytest
import waves
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.images import image_noise as measured
from rover_obstacle_detection.detection.images.brightness import Spread
from rover_obstacle_detection.detection.images.parameters import ImageParameters

PARAMETERS = ImageParameters()
SHAPE = (150, 200)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
SCENES = {
    'flat': np.full(SHAPE, 128.0),
    'rising along the row': 40 + 0.8 * COLUMNS,
    'rising along the diagonal': 40 + 0.3 * COLUMNS + 0.6 * ROWS,
    'blocks': 80 + 90 * ((COLUMNS // 20 + ROWS // 20) % 2),
    'texture of 16 px and more': waves.texture(COLUMNS, ROWS, shortest_px=16),
}


def image_noise(image):
    return measured.image_noise(image, PARAMETERS).overall


def gradient_level(image):
    return measured.image_gradient(image, PARAMETERS).overall


def noise_share(image):
    noise = measured.image_noise(image, PARAMETERS)
    gradient = measured.image_gradient(image, PARAMETERS)
    return measured.noise_share(noise, gradient, PARAMETERS)


def smoothed(image, share, noise=1.0):
    noise, share = (Spread(each, everywhere(each)) for each in (noise, share))
    return measured.smoothed_against_noise(image, noise, share, PARAMETERS)


def everywhere(value):
    return np.full(256, value, np.float32)


@pytest.mark.parametrize('sigma', [1.0, 2.0, 4.0, 8.0])
@pytest.mark.parametrize('name', SCENES)
def test_noise_is_measured_independently_of_the_content(name, sigma):
    image = waves.as_image(SCENES[name], sigma)
    # Rounding to whole levels adds 0.3.
    assert image_noise(image) == pytest.approx(np.hypot(sigma, 0.3), rel=0.08)


def test_fine_texture_hardly_counts_as_noise():
    fine = waves.texture(COLUMNS, ROWS, shortest_px=5)
    assert image_noise(waves.as_image(fine)) < 0.25 * fine.std()


@pytest.mark.parametrize('name', ['flat', 'blocks'])
def test_clean_image_has_the_smallest_noise(name):
    assert image_noise(waves.as_image(SCENES[name])) == 0.5


@pytest.mark.parametrize('level', [0, 255])
def test_fully_clipped_image_has_the_smallest_noise(level):
    image = waves.as_image(np.full(SHAPE, level * 2.0 - 127), 5.0)
    assert image.min() == image.max() == level
    assert image_noise(image) == 0.5
    assert gradient_level(image) == pytest.approx(0.1)


@pytest.mark.parametrize('level', [0, 2, 253, 255])
def test_clipped_parts_are_excluded(level):
    image = waves.as_image(SCENES['flat'], 4.0)
    image[:75] = level
    assert image_noise(image) == pytest.approx(4.0, rel=0.15)


def test_large_images_are_measured_on_a_sample():
    image = waves.as_image(np.full((700, 900), 128.0), 3.0)
    assert image_noise(image) == pytest.approx(3.0, rel=0.03)


@pytest.mark.parametrize('rise', [1, 3])
def test_gradient_is_the_change_per_pixel_along_the_row(rise):
    ramp = np.tile(np.arange(60) * rise, (40, 1)).astype(np.uint8)
    # The standard deviation of normal values with this median magnitude.
    assert gradient_level(ramp) == pytest.approx(1.4826 * rise)
    assert gradient_level(np.ascontiguousarray(ramp.T)) == pytest.approx(0.1)


def test_small_images_are_measured_at_every_column():
    columns = np.arange(40)
    # The neighbours of odd columns differ by 2 per column, those of even ones by 4.
    row = np.where(columns % 2, 4 * columns, 2 * columns)
    found = gradient_level(np.tile(row, (30, 1)).astype(np.uint8))
    assert found == pytest.approx(1.4826 * 2)


def test_gradient_level_is_the_standard_deviation_of_the_gradient():
    texture = waves.texture(COLUMNS, ROWS)
    expected = (texture[:, 2:] - texture[:, :-2]).std() / 2
    assert gradient_level(waves.as_image(texture)) == pytest.approx(expected, rel=0.1)


def test_share_is_0_for_rich_texture_and_1_for_noise_alone():
    texture = waves.texture(COLUMNS, ROWS)
    for image, share in (
        (waves.as_image(texture, 1.5), 0),
        (waves.as_image(SCENES['flat'], 1.5), 1),
        (waves.as_image(128 + 0.05 * (texture - 128), 5.0), 1),
    ):
        found = noise_share(image)
        assert found.overall == share
        assert (found.by_brightness == share).all()


def test_share_grows_with_the_noise():
    texture = waves.texture(COLUMNS, ROWS, shortest_px=16, contrast=12.0)
    noises = np.arange(0, 8, 0.5)
    shares = [noise_share(waves.as_image(texture, sigma)).overall for sigma in noises]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0, 1)
    assert any(0 < share < 1 for share in shares)


def test_share_differs_in_light_and_shadow():
    # The same ground and noise, and a tenth of the light on the right.
    light = np.where(COLUMNS < 100, 1.0, 0.1)
    share = noise_share(waves.as_image(light * waves.texture(COLUMNS, ROWS), 2.0))
    assert share.overall < 0.5
    assert share.by_brightness[128] == 0
    assert share.by_brightness[13] == 1


@given(
    contrast=st.floats(0, 200),
    noise=st.floats(0, 60),
    shape=st.tuples(st.integers(1, 20), st.integers(1, 20)),
)
def test_share_is_between_0_and_1(contrast, noise, shape):
    generator = np.random.default_rng(0)
    image = 128 + contrast * np.sin(np.arange(shape[1])) + generator.normal(0, noise, shape)
    share = noise_share(np.clip(image, 0, 255).astype(np.uint8))
    assert 0 <= share.overall <= 1
    assert ((share.by_brightness >= 0) & (share.by_brightness <= 1)).all()


NOISY = waves.as_image(SCENES['flat'], 8.0)


def test_share_of_0_returns_the_image_itself():
    found = smoothed(NOISY, 0.0, noise=3.0)
    assert found.grey is NOISY
    assert (found.noise.overall, found.share) == (3.0, 0.0)


def test_share_of_1_smooths_by_a_pixel():
    found = smoothed(NOISY, 1.0)
    assert found.grey.dtype == np.uint8
    expected = cv2.GaussianBlur(NOISY, (0, 0), 1.0)
    assert cv2.absdiff(found.grey, expected).max() <= 1


def test_smoothing_grows_with_the_share():
    spreads = [smoothed(NOISY, share).grey.std() for share in (0, 0.4, 0.7, 1.0)]
    assert spreads == sorted(spreads, reverse=True)
    # A Gaussian of one pixel averages 4 pi pixels.
    assert spreads[-1] == pytest.approx(8 / np.sqrt(4 * np.pi), rel=0.1)


def test_smoothing_does_not_shift_the_image():
    spot = np.zeros((9, 9), np.uint8)
    spot[4, 3] = 255
    found = smoothed(spot, 0.8).grey
    beside, mirrored = found[:, 3 + np.arange(1, 4)], found[:, 3 - np.arange(1, 4)]
    # Rounding may differ by a level.
    assert cv2.absdiff(beside.copy(), mirrored.copy()).max() <= 1
    assert found.argmax() == spot.argmax()


def test_only_what_is_hidden_by_noise_is_smoothed():
    image = waves.as_image(np.where(COLUMNS < 100, 160.0, 20.0), 4.0)
    share = Spread(0.3, np.where(np.arange(256) < 60, 1, 0).astype(np.float32))
    spread = Spread(4.0, everywhere(4.0))
    found = measured.smoothed_against_noise(image, spread, share, PARAMETERS)
    # Where the window that measures brightness lies in one half.
    np.testing.assert_array_equal(found.grey[:, :94], image[:, :94])
    assert found.grey[:, 106:].std() == pytest.approx(4 / np.sqrt(4 * np.pi), rel=0.1)
    assert found.share == 0.3
    assert found.noise.by_brightness[160] == 4
    # Smoothing leaves this, and the new grey levels are rounded.
    left = np.hypot(4 / np.sqrt(4 * np.pi), 12**-0.5)
    assert found.noise.by_brightness[20] == pytest.approx(left, rel=0.02)
    assert found.noise.overall == pytest.approx((4 + left) / 2, rel=0.02)


@pytest.mark.parametrize('share', [0.0, 0.5, 1.0])
def test_gradient_of_noise_alone_is_known(share):
    found = smoothed(waves.as_image(SCENES['flat'], 8.0), share, noise=8.0)
    gradient = measured.image_gradient(found.grey, PARAMETERS)
    assert found.noise_gradient[128] == pytest.approx(gradient.by_brightness[128], rel=0.05)


@pytest.mark.parametrize('share', [0.0, 0.3, 0.6, 1.0])
def test_noise_that_smoothing_leaves_is_known(share):
    noisy = waves.as_image(np.full(SHAPE, 128.0), 20.0)
    remaining = measured.remaining_noise(everywhere(share), PARAMETERS)
    assert remaining.shape == (256,)
    assert remaining[0] == pytest.approx(smoothed(noisy, share).grey.std() / noisy.std(), rel=0.05)
    assert (remaining[0] == 1) == (share == 0)
