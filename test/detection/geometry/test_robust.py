from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.robust import quantile, robust_spread


@pytest.mark.parametrize('sigma', [0.2, 7.0])
def test_spread_of_normal_values_is_their_standard_deviation(sigma):
    values = np.random.default_rng(0).normal(0, sigma, (300, 100))
    assert robust_spread(values) == pytest.approx(sigma, rel=0.02)


def test_outliers_hardly_count():
    values = np.random.default_rng(0).normal(0, 1, 10_000).astype(np.float32)
    values[:500] = 1e6
    assert robust_spread(values) == pytest.approx(1, rel=0.1)


def test_spread_of_nothing_is_zero():
    assert robust_spread(np.zeros(0, np.int16)) == 0.0


@pytest.mark.parametrize('share', [0.0, 0.002, 0.5, 0.7, 0.998, 1.0])
@pytest.mark.parametrize('size', [1, 2, 3, 100, 1001])
@pytest.mark.parametrize('dtype', [np.float32, np.float64, np.int16])
def test_quantile_is_that_of_numpy(share, size, dtype):
    values = (np.random.default_rng(size).normal(size=size) * 1000).astype(dtype)
    assert quantile(values, share) == pytest.approx(np.quantile(values, share), rel=1e-6, abs=1e-4)


def test_quantile_takes_an_image_as_a_whole():
    assert quantile(np.array([[4, 1], [3, 2]], np.uint8), 0.5) == 2.5
