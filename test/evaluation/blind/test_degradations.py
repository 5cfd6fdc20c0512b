"""Damage to single images, worked out by hand or measured."""

from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.evaluation.blind import degradations

SHAPE = (120, 160)
PATTERN = np.random.default_rng(5).integers(60, 190, SHAPE).astype(np.uint8)


def contrast(image: np.ndarray) -> float:
    return float(image.std())


def test_flat_image_has_its_level_and_noise() -> None:
    assert (degradations.flat(SHAPE, 128) == 128).all()
    noisy = degradations.flat(SHAPE, 128, 4.0)
    assert noisy.mean() == pytest.approx(128, abs=0.2)
    assert noisy.std() == pytest.approx(4.0, rel=0.05)


def test_noise_is_repeatable_and_differs_between_images() -> None:
    first = degradations.noisy(PATTERN, 10.0, seed=0)
    np.testing.assert_array_equal(first, degradations.noisy(PATTERN, 10.0, seed=0))
    second = degradations.noisy(PATTERN, 10.0, seed=1)
    difference = first.astype(float) - second
    assert difference.std() == pytest.approx(10 * np.sqrt(2), rel=0.05)


def test_values_are_rounded_and_clipped() -> None:
    values = np.array([[-3.0, 0.4, 0.6, 255.4, 300.0]], np.float32)
    assert degradations.to_grey(values).tolist() == [[0, 0, 1, 255, 255]]


def test_blur_spreads_an_edge_over_its_width() -> None:
    edge = np.zeros((40, 80), np.uint8)
    edge[:, 40:] = 200
    widths = []
    for sigma_px in (2.0, 4.0):
        profile = degradations.blurred(edge, sigma_px).mean(axis=0)
        widths.append(np.count_nonzero((profile > 32) & (profile < 168)))
    # One standard deviation on either side lies between 16 and 84 %.
    assert widths == [4, 8]


def test_motion_blur_smears_rows_only() -> None:
    lines = np.zeros((60, 60), np.uint8)
    lines[:, 30] = 210
    smeared = degradations.motion_blurred(lines, 21).mean(axis=0)
    assert smeared[20:41] == pytest.approx(10.0, abs=1.0)
    assert smeared[:19].max() < 2
    rows = np.zeros((60, 60), np.uint8)
    rows[30] = 210
    assert degradations.motion_blurred(rows, 21)[30].mean() == pytest.approx(210, abs=1)


def test_exposure_scales_and_clips() -> None:
    image = np.array([[0, 10, 100, 200]], np.uint8)
    assert degradations.over_exposed(image, 2.5).tolist() == [[0, 25, 250, 255]]
    wide = np.full((50, 50), 100, np.uint8)
    assert degradations.under_exposed(wide, 0.3).mean() == pytest.approx(26, abs=0.2)
    assert degradations.under_exposed(wide, 0.01).mean() < 0.1


def test_fog_keeps_a_share_of_the_contrast() -> None:
    thin, thick = (degradations.foggy(PATTERN, share) for share in (0.3, 0.03))
    assert contrast(thin) == pytest.approx(0.3 * contrast(PATTERN), rel=0.05)
    assert contrast(thick) < 2.0
    assert thick.mean() == pytest.approx(0.03 * PATTERN.mean() + 0.97 * 160, abs=0.3)


def test_jpeg_gets_worse_with_less_quality() -> None:
    errors = [
        np.abs(degradations.as_jpeg(PATTERN, quality).astype(float) - PATTERN).mean()
        for quality in (90, 30, 3)
    ]
    assert errors == sorted(errors)
    assert errors[0] < 5 < errors[2]


def test_content_is_shifted_and_the_border_repeated() -> None:
    image = np.arange(12, dtype=np.uint8).reshape(3, 4)
    assert degradations.shifted(image, columns=1)[0].tolist() == [0, 0, 1, 2]
    assert degradations.shifted(image, columns=-2)[0].tolist() == [2, 3, 3, 3]
    assert degradations.shifted(image, rows=1)[:, 0].tolist() == [0, 0, 4]


def test_zoom_moves_content_away_from_the_centre() -> None:
    image = np.zeros((41, 41), np.uint8)
    image[20, 30] = 200
    image[20, 20] = 100
    zoomed = degradations.zoomed(image, 1.5)
    assert zoomed[20, 35] == 200
    assert zoomed[20, 20] == 100


def test_covered_area_is_dark_and_the_rest_untouched() -> None:
    area = np.zeros(SHAPE, bool)
    area[:, 80:] = True
    covered = degradations.covered(PATTERN, area)
    np.testing.assert_array_equal(covered[:, :80], PATTERN[:, :80])
    assert covered[:, 80:].mean() == pytest.approx(8.0, abs=0.1)
    assert covered[:, 80:].std() == pytest.approx(1.0, abs=0.1)


def test_dirt_covers_its_share_in_a_few_blobs_and_grows() -> None:
    little, much = (degradations.dirt(SHAPE, share) for share in (0.15, 0.4))
    assert little.mean() == pytest.approx(0.15, abs=0.01)
    assert much.mean() == pytest.approx(0.4, abs=0.01)
    assert (much >= little - 1e-6).all()
    assert ((little > 0.1) & (little < 0.9)).mean() < 0.1
    dirty = degradations.dirty(PATTERN, much)
    assert dirty[much > 0.99].mean() == pytest.approx(degradations.DIRT_LEVEL, abs=0.5)
    clear = dirty[much == 0].astype(float) - PATTERN[much == 0]
    assert clear.std() == pytest.approx(1.0, abs=0.1)


def test_featureless_is_a_whole_clipped_window() -> None:
    clipped = np.ones((20, 20), bool)
    clipped[10, 10] = False
    blind = degradations.featureless(clipped)
    assert not blind[6:15, 6:15].any()
    assert blind[:6].all()
    assert blind[15:].all()
