from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.study.morphology import close_then_open


def block():
    mask = np.zeros((60, 80), np.uint8)
    mask[20:45, 20:60] = 255
    return mask


@pytest.mark.parametrize('iterations', [1, 2])
def test_small_holes_are_filled(iterations):
    holed = block()
    holed[30:34, 35:40] = 0
    closed = close_then_open(holed, 7, iterations)
    np.testing.assert_array_equal(closed, close_then_open(block(), 7, iterations))
    assert (closed[25:40, 25:55] == 255).all()


def test_specks_are_removed():
    specked = block()
    specked[5:8, 5:8] = 255
    np.testing.assert_array_equal(close_then_open(specked, 7, 2), close_then_open(block(), 7, 2))
    assert not close_then_open(specked, 7, 2)[:15].any()


def test_gaps_wider_than_the_kernel_stay_open():
    parted = block()
    parted[:, 32:52] = 0
    assert not close_then_open(parted, 3, 1)[:, 34:50].any()


def test_result_has_only_the_values_of_the_mask():
    mask = np.where(np.random.default_rng(0).random((40, 50)) < 0.4, 255, 0).astype(np.uint8)
    result = close_then_open(mask, 5, 1)
    assert result.dtype == np.uint8
    assert result.shape == mask.shape
    assert set(np.unique(result)) <= {0, 255}


@pytest.mark.parametrize('size', [1, 7])
def test_no_iterations_leave_the_mask_unchanged(size):
    mask = block()
    mask[0, 0] = 255
    np.testing.assert_array_equal(close_then_open(mask, size, 0), mask)


@pytest.mark.parametrize('value', [0, 255])
def test_uniform_masks_stay_unchanged(value):
    mask = np.full((9, 9), value, np.uint8)
    np.testing.assert_array_equal(close_then_open(mask, 7, 2), mask)
