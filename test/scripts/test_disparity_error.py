"""Errors of disparity, worked out by hand, and the pair that comes with scikit-image."""

from __future__ import annotations

import sys

import cv2
import numpy as np
import pytest
from studies.motorcycle import load_motorcycle

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.evaluation.disparity_error import (
    DisparityErrors,
    pooled_errors,
    seen_by_both,
    true_disparity,
)
from rover_obstacle_detection.evaluation.methods.dense_stereo import match_plainly

CAMERA = StereoCamera(10, 1, 20.0, 20.0, 4.5, 0.0, 0.5)


def row(*values: float) -> np.ndarray:
    return np.array([values], np.float32)


def errors(disparity: np.ndarray, truth: np.ndarray) -> DisparityErrors:
    return DisparityErrors.of(disparity, truth, np.ones(truth.shape, bool))


def test_errors_of_what_is_matched_and_known() -> None:
    found = errors(row(10.0, 10.5, 13.0, 0.0, 9.0), row(10.25, 10.0, 10.0, 10.0, np.nan))
    assert (found.matched, found.missing) == (3, 1)
    assert found.density == 0.75
    assert found.mean_px == pytest.approx(3.75 / 3)
    assert found.median_px == pytest.approx(0.5, abs=1 / 64)
    assert [found.share_off(px) for px in (0.25, 0.5, 1, 2)] == [
        1.0,
        *[pytest.approx(2 / 3)],
        *[pytest.approx(1 / 3)] * 2,
    ]


def test_only_the_pixels_asked_for_count() -> None:
    where = np.array([[True, False]])
    found = DisparityErrors.of(row(5.0, 9.0), row(5.0, 5.0), where)
    assert (found.matched, found.mean_px) == (1, 0.0)


def test_gross_errors_count_in_full() -> None:
    found = errors(row(90.0, 90.0, 10.0), row(10.0, 10.0, 10.0))
    assert found.mean_px == pytest.approx(160 / 3)
    assert found.median_px == 4.0, 'the edge of what is told apart'
    assert found.share_off(2) == pytest.approx(2 / 3)


def test_nothing_matched_has_no_error() -> None:
    found = errors(row(0.0), row(5.0))
    assert (found.density, found.mean_px, found.median_px, found.share_off(1)) == (0, *[None] * 3)
    assert errors(row(3.0), row(np.nan)).density is None


def test_sums_are_over_both() -> None:
    first, second = errors(row(10.0, 0.0), row(10.0, 9.0)), errors(row(12.0), row(10.0))
    whole = pooled_errors([first, second])
    assert (whole.matched, whole.missing) == (2, 1)
    assert whole.mean_px == 1.0
    assert pooled_errors([]).density is None


def test_the_median_agrees_with_that_of_the_numbers() -> None:
    rng = np.random.default_rng(3)
    truth = rng.uniform(5, 50, (30, 40)).astype(np.float32)
    disparity = (truth + rng.normal(0, 0.4, truth.shape)).astype(np.float32)
    expected = np.median(np.abs(disparity - truth))
    assert errors(disparity, truth).median_px == pytest.approx(expected, abs=1 / 64)


def test_depth_gives_disparity() -> None:
    disparity = true_disparity(row(2.0, np.nan), CAMERA)
    assert disparity[0, 0] == 5.0
    assert np.isnan(disparity[0, 1])


def test_what_the_right_eye_does_not_see() -> None:
    # A block of 5 px before a wall of 2 px hides columns 2 and 3; the first two lie outside.
    truth = row(2, 2, 2, 2, 2, 5, 5, 2, np.nan, 2)
    assert seen_by_both(truth, CAMERA)[0].tolist() == [
        False, False, False, False, True, True, True, True, False, True,
    ]  # fmt: skip


def test_the_offset_of_the_right_eye_counts() -> None:
    shifted = StereoCamera(10, 1, 20.0, 20.0, 4.5, 0.0, 0.5, cx_right=6.5)
    truth = row(*[3.0] * 10)
    assert seen_by_both(truth, CAMERA)[0].sum() == 7
    assert seen_by_both(truth, shifted)[0].sum() == 9


def test_the_pair_of_scikit_image_is_what_its_disparity_says() -> None:
    pytest.importorskip('skimage', reason='needs the extra data')
    pair = load_motorcycle()
    raw = pair.disparity + pair.camera.disparity_offset
    assert pair.left.shape == pair.right.shape == (500, 741, 3)
    assert 7 < np.nanmin(raw) < np.nanmax(raw) < 64
    columns = np.arange(741, dtype=np.float32) - np.nan_to_num(raw)
    rows = np.repeat(np.arange(500, dtype=np.float32)[:, np.newaxis], 741, axis=1)
    carried = cv2.remap(pair.right, columns, rows, cv2.INTER_LINEAR)
    seen = seen_by_both(pair.disparity, pair.camera)
    assert 0.8 < seen.mean() < 0.9
    assert np.median(cv2.absdiff(carried, pair.left)[seen]) < 5
    plain = match_plainly(pair.camera, pair.left, pair.right, DetectorConfig())
    found = DisparityErrors.of(plain, pair.disparity, seen)
    assert found.density > 0.8
    assert found.median_px < 0.25
    assert found.share_off(2) < 0.06


def test_without_scikit_image_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'skimage.data', None)
    with pytest.raises(MissingExtraError, match=r"scikit-image.*detection\[data\]'"):
        load_motorcycle()
