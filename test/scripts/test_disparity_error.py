"""Errors of disparity, worked out by hand, and the Middlebury pair of scikit-image."""

from __future__ import annotations

import sys

import cv2
import numpy as np
import pytest
from studies.disparity_error import DisparityErrors, pooled_errors
from studies.motorcycle import load_motorcycle

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.errors import MissingExtraError
from rover_obstacle_detection.evaluation.methods.dense_stereo import match_plainly
from rover_obstacle_detection.evaluation.true_disparity import visible_in_both


def row(*values: float) -> np.ndarray:
    return np.array([values], np.float32)


def errors(disparity: np.ndarray, truth: np.ndarray) -> DisparityErrors:
    return DisparityErrors.of(disparity, truth, np.ones(truth.shape, bool))


def test_errors_of_matched_pixels_with_known_truth() -> None:
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


def test_only_chosen_pixels_count() -> None:
    where = np.array([[True, False]])
    found = DisparityErrors.of(row(5.0, 9.0), row(5.0, 5.0), where)
    assert (found.matched, found.mean_px) == (1, 0.0)


def test_large_errors_count_in_full() -> None:
    found = errors(row(90.0, 90.0, 10.0), row(10.0, 10.0, 10.0))
    assert found.mean_px == pytest.approx(160 / 3)
    assert found.median_px == 4.0, 'edge of the last bin'
    assert found.share_off(2) == pytest.approx(2 / 3)


def test_no_match_has_no_error() -> None:
    found = errors(row(0.0), row(5.0))
    assert (found.density, found.mean_px, found.median_px, found.share_off(1)) == (0, *[None] * 3)
    assert errors(row(3.0), row(np.nan)).density is None


def test_adding_errors_pools_them() -> None:
    first, second = errors(row(10.0, 0.0), row(10.0, 9.0)), errors(row(12.0), row(10.0))
    whole = pooled_errors([first, second])
    assert (whole.matched, whole.missing) == (2, 1)
    assert whole.mean_px == 1.0
    assert pooled_errors([]).density is None


def test_binned_median_agrees_with_the_exact_one() -> None:
    rng = np.random.default_rng(3)
    truth = rng.uniform(5, 50, (30, 40)).astype(np.float32)
    disparity = (truth + rng.normal(0, 0.4, truth.shape)).astype(np.float32)
    expected = np.median(np.abs(disparity - truth))
    assert errors(disparity, truth).median_px == pytest.approx(expected, abs=1 / 64)


def test_middlebury_pair_agrees_with_its_disparity() -> None:
    pytest.importorskip('skimage', reason='needs the extra data')
    pair = load_motorcycle()
    raw = pair.disparity + pair.camera.disparity_offset
    assert pair.left.shape == pair.right.shape == (500, 741, 3)
    assert 7 < np.nanmin(raw) < np.nanmax(raw) < 64
    columns = np.arange(741, dtype=np.float32) - np.nan_to_num(raw)
    rows = np.repeat(np.arange(500, dtype=np.float32)[:, np.newaxis], 741, axis=1)
    warped = cv2.remap(pair.right, columns, rows, cv2.INTER_LINEAR)
    visible = visible_in_both(pair.disparity, pair.camera)
    assert 0.8 < visible.mean() < 0.9
    assert np.median(cv2.absdiff(warped, pair.left)[visible]) < 5
    plain = match_plainly(pair.camera, pair.left, pair.right, DetectorConfig())
    found = DisparityErrors.of(plain, pair.disparity, visible)
    assert found.density > 0.8
    assert found.median_px < 0.25
    assert found.share_off(2) < 0.06


def test_missing_scikit_image_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'skimage.data', None)
    with pytest.raises(MissingExtraError, match=r'scikit-image.*pip install scikit-image'):
        load_motorcycle()
