from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.detection.terrain.local_regression import LocalPlanes
from rover_obstacle_detection.detection.terrain.viewpoint import Sight, lever_m

SHAPE = (20, 30)


def plane(level=0.0, along_rows=0.0, along_columns=0.0):
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
    ones = np.ones(SHAPE, np.float32)
    height = level + along_rows * rows + along_columns * columns
    return LocalPlanes(height, along_columns * ones, along_rows * ones, ones, ones)


def sight(share=0.01):
    return Sight(2.0, 15.0, -40.0, np.full(SHAPE, share, np.float32))


def test_eye_is_as_high_over_every_cell_of_one_plane():
    np.testing.assert_allclose(sight().over(plane(0.5)), 1.5, rtol=1e-5)
    # 40 rows back and on column 15 the plane is at 0.5 - 40 * 0.02 + 15 * 0.1 = 1.2.
    np.testing.assert_allclose(sight().over(plane(0.5, 0.02, 0.1)), 0.8, rtol=1e-4)


def test_a_bank_that_faces_the_eye_has_more_noise_than_one_that_falls_away():
    facing, level, falling = (sight().noise_m(plane(0.0, rise)) for rise in (0.02, 0, -0.02))
    np.testing.assert_allclose(level, 0.02, rtol=1e-5)
    np.testing.assert_allclose(facing, 0.028, rtol=1e-4)
    np.testing.assert_allclose(falling, 0.012, rtol=1e-4)


@pytest.mark.parametrize(('over', 'expected'), [(2.0, 2.0), (0.1, 0.6), (0.0, 0.6), (-3.0, 3.0)])
def test_seen_from_below_or_along_itself_ground_has_noise_as_well(over, expected):
    np.testing.assert_allclose(lever_m(np.float32([over]), 2.0), expected)
