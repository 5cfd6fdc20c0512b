from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_obstacle_detection.detection.images.edges import edge_strength
from rover_obstacle_detection.detection.images.parameters import ImageParameters

PARAMETERS = ImageParameters()


@pytest.mark.parametrize('shape', [(40, 60), (41, 61), (1, 1)])
def test_uniform_image_has_no_edges(shape):
    strength = edge_strength(np.full(shape, 77, np.uint8), PARAMETERS)
    assert strength.shape == ((shape[0] + 1) // 2, (shape[1] + 1) // 2)
    assert strength.dtype == np.float32
    assert not strength.any()


@pytest.mark.parametrize('transposed', [False, True])
def test_grey_level_step_is_an_edge_there_only(transposed):
    grey = np.full((40, 60), 50, np.uint8)
    grey[:, 30:] = 150
    strength = edge_strength(grey.T if transposed else grey, PARAMETERS)
    strength = strength.T if transposed else strength
    assert strength[:, 14:16].min() > 20
    assert strength[:, :11].max() < 0.5
    assert strength[:, 19:].max() < 0.5


def test_strength_of_a_ramp_is_its_slope():
    grey = np.tile(np.arange(0, 240, 3, dtype=np.uint8), (20, 1))
    assert edge_strength(grey, PARAMETERS)[:, 5:-5] == pytest.approx(6, abs=0.3)
    coarse = edge_strength(grey, replace(PARAMETERS, edge_reduction=3))
    assert coarse.shape == (7, 27)
    assert coarse[:, 5:-5] == pytest.approx(9, abs=0.3)


def test_edges_across_are_as_strong_as_edges_down():
    grey = np.random.default_rng(0).integers(0, 256, (30, 41), np.uint8)
    transposed = edge_strength(np.ascontiguousarray(grey.T), PARAMETERS)
    np.testing.assert_allclose(edge_strength(grey, PARAMETERS), transposed.T, rtol=1e-4)


def test_last_row_and_column_of_odd_sizes_are_repeated():
    grey = np.random.default_rng(0).integers(0, 256, (31, 41), np.uint8)
    repeated = np.pad(grey, ((0, 1), (0, 1)), mode='edge')
    expected = edge_strength(repeated, PARAMETERS)
    np.testing.assert_array_equal(edge_strength(grey, PARAMETERS), expected)


def test_result_does_not_depend_on_memory_alignment():
    grey = np.random.default_rng(0).integers(0, 256, (203, 317), dtype=np.uint8)
    expected = edge_strength(grey, PARAMETERS)
    for offset in range(1, 6):
        buffer = np.zeros(grey.size + offset, np.uint8)
        shifted = buffer[offset:].reshape(grey.shape)
        shifted[:] = grey
        np.testing.assert_array_equal(edge_strength(shifted, PARAMETERS), expected)
