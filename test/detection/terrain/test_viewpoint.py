from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.terrain.local_regression import LocalPlanes
from rover_obstacle_detection.detection.terrain.viewpoint import Viewpoint, lever_m

SHAPE = (20, 30)


def plane(level=0.0, along_rows=0.0, along_columns=0.0):
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
    ones = np.ones(SHAPE, np.float32)
    height = level + along_rows * rows + along_columns * columns
    return LocalPlanes(height, along_columns * ones, along_rows * ones, ones, ones)


VIEWPOINT = Viewpoint(2.0, 15.0, -40.0, np.full(SHAPE, 0.01, np.float32), 0.3)


def test_camera_is_equally_high_above_all_cells_of_a_plane():
    np.testing.assert_allclose(VIEWPOINT.above(plane(0.5)), 1.5, rtol=1e-5)
    # 40 rows back and on column 15 the plane is at 0.5 - 40 * 0.02 + 15 * 0.1 = 1.2.
    np.testing.assert_allclose(VIEWPOINT.above(plane(0.5, 0.02, 0.1)), 0.8, rtol=1e-4)


def test_bank_facing_the_camera_has_more_noise_than_one_that_falls_away():
    facing, level, falling = (VIEWPOINT.noise_m(plane(0.0, rise)) for rise in (0.02, 0, -0.02))
    np.testing.assert_allclose(level, 0.02, rtol=1e-5)
    np.testing.assert_allclose(facing, 0.028, rtol=1e-4)
    np.testing.assert_allclose(falling, 0.012, rtol=1e-4)


@pytest.mark.parametrize(
    ('descent', 'expected'), [(2.0, 2.0), (0.1, 0.6), (0.0, 0.6), (-3.0, 3.0)]
)
def test_lever_is_positive_from_below_and_along_the_ground(descent, expected):
    np.testing.assert_allclose(lever_m(np.float32([descent]), 2.0, 0.3), expected)
