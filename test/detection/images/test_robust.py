from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.images.robust import robust_spread


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
