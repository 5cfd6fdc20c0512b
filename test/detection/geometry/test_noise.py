from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.noise import height_noise_m


def row(*values):
    return np.array([values], np.float32)


def test_noise_is_inversely_proportional_to_disparity():
    disparity = row(40, 20, 10)
    noise = height_noise_m(disparity, 1.5, 0.25)
    assert noise.dtype == np.float32
    np.testing.assert_allclose(noise, 1.5 * 0.25 / disparity, rtol=1e-6)


@pytest.mark.parametrize('disparity', [6.0, 10.0, 25.0])
def test_noise_is_the_height_change_of_a_ground_point_per_disparity_change(disparity):
    def height_above_ground(changed):
        return 1.5 - 1.5 * disparity / changed

    change = height_above_ground(disparity + 0.005) - height_above_ground(disparity - 0.005)
    noise = height_noise_m(row(disparity), 1.5, 0.25)
    assert noise[0, 0] == pytest.approx(change / 0.01 * 0.25, rel=1e-3)


def test_noise_is_infinite_without_a_match():
    np.testing.assert_array_equal(height_noise_m(row(0, 5), 1.0, 0.25), row(np.inf, 0.05))


def test_height_and_disparity_noise_may_vary_per_pixel():
    noise = height_noise_m(row(40, 20, 0), row(1.5, 1.0, 1.0), row(0.25, 0.1, 0.1))
    assert noise.dtype == np.float32
    np.testing.assert_allclose(noise, row(1.5 * 0.25 / 40, 0.1 / 20, np.inf), rtol=1e-6)
