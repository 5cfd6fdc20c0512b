from __future__ import annotations

import numpy as np
import pytest

from rover_obstacle_detection.simulation.description import TruthParameters
from rover_obstacle_detection.simulation.labels import (
    DROP,
    FREE,
    NOT_COUNTED,
    ROCK,
    SLOPE,
    LocalGround,
    label,
    local_ground,
    survey,
)

TRUTH = TruthParameters()
CELL = 0.05


def flat(slope_deg=0.0, drop_m=0.0, size=40):
    shape = (size, size)
    return LocalGround(
        0.0,
        0.0,
        CELL,
        np.zeros(shape, np.float32),
        np.full(shape, slope_deg, np.float32),
        np.full(shape, drop_m, np.float32),
    )


def pixels(instances, top_m=0.0, depth_m=1.0):
    instances = np.array(instances, np.uint16)
    points = np.ones((*instances.shape, 3))
    points[..., 2] = np.where(instances > 0, top_m, 0.0)
    return points, np.full(instances.shape, depth_m, np.float32), instances


@pytest.mark.parametrize(
    ('height_m', 'expected'),
    [(0.05, FREE), (0.079, FREE), (0.081, NOT_COUNTED), (0.119, NOT_COUNTED), (0.121, ROCK)],
)
def test_rock_label_depends_on_height_and_clearance(height_m, expected):
    points, depth, instances = pixels([[0, 0, 0], [0, 1, 0], [0, 0, 0]], top_m=height_m)
    labels = label(points, depth, instances, np.array([0, height_m]), flat(), TRUTH)
    assert labels[1, 1] == expected
    assert (np.delete(labels.ravel(), 4) == FREE).all()


def test_low_rock_on_a_slope_is_labelled_as_slope():
    points, depth, instances = pixels([[0, 0, 0, 0], [0, 1, 2, 0], [0, 0, 0, 0]], top_m=0.2)
    labels = label(points, depth, instances, np.array([0, 0.2, 0.03]), flat(25.0), TRUTH)
    assert labels[1].tolist() == [SLOPE, ROCK, SLOPE, SLOPE]


def test_slope_takes_precedence_over_drop():
    points, depth, instances = pixels([[0]])
    for slope, drop, expected in (
        (20.5, 0.5, SLOPE),
        (19.5, 0.11, DROP),
        (19.5, 0.09, FREE),
    ):
        labels = label(points, depth, instances, np.zeros(1), flat(slope, drop), TRUTH)
        assert labels[0, 0] == expected


def test_sky_and_distant_ground_are_not_counted():
    points, depth, instances = pixels([[0, 0, 0]])
    depth[0, 0], depth[0, 1] = np.nan, 41.0
    labels = label(points, depth, instances, np.zeros(1), flat(30.0), TRUTH)
    assert labels[0].tolist() == [NOT_COUNTED, NOT_COUNTED, SLOPE]


@pytest.mark.parametrize(
    ('visible_m', 'at_edge', 'expected'),
    [(0.13, True, ROCK), (0.11, True, NOT_COUNTED), (0.11, False, ROCK)],
)
def test_visible_height_decides_for_rocks_at_the_image_border(visible_m, at_edge, expected):
    rows = [[0, 0, 0], [1, 1, 0], [0, 0, 0]] if at_edge else [[0, 0, 0], [0, 1, 0], [0, 0, 0]]
    points, depth, instances = pixels(rows, top_m=visible_m)
    labels = label(points, depth, instances, np.array([0, 0.3]), flat(), TRUTH)
    assert labels[1, 1] == expected


def grid(size_m=8.0):
    axis = np.arange(0, size_m, CELL) - size_m / 2
    return np.meshgrid(axis.astype(np.float32), axis.astype(np.float32))


def inner(values, margin=30):
    return values[margin:-margin, margin:-margin]


@pytest.mark.parametrize('slope_deg', [5.0, 26.0])
def test_survey_of_a_plane(slope_deg):
    x, y = grid()
    relief = (np.tan(np.radians(slope_deg)) * (0.6 * x + 0.8 * y)).astype(np.float32)
    ground = survey(relief, 0.0, 0.0, CELL)
    np.testing.assert_allclose(inner(ground.slope_deg), slope_deg, atol=0.01)
    assert inner(ground.drop_m).max() < 1e-3


def test_pit_is_a_drop_but_wide_basin_is_not():
    x, y = grid()
    pit = np.where(np.hypot(x, y) < 0.6, -0.3, 0.0).astype(np.float32)
    ground = survey(pit, -4.0, -4.0, CELL)
    at = (np.array([0.0, 0.3, 0.9]), np.zeros(3))
    np.testing.assert_allclose(ground.read(ground.drop_m, *at), [0.3, 0.3, 0.0], atol=0.01)
    basin = (0.02 * np.minimum(np.hypot(x, y), 3.0) ** 2).astype(np.float32)
    assert inner(survey(basin, 0.0, 0.0, CELL).drop_m).max() < 0.03


def test_survey_smooths_pebbles_but_not_hills():
    x, _ = grid()
    fine = 0.01 * np.sin(2 * np.pi * x / 0.15)
    ground = survey((fine + 0.1 * x).astype(np.float32), 0.0, 0.0, CELL)
    np.testing.assert_allclose(inner(ground.slope_deg), np.degrees(np.arctan(0.1)), atol=0.1)


def test_local_ground_reads_heights_at_positions():
    ground = local_ground(lambda x, y: (0.2 * x - 0.1 * y).astype(np.float32), (1, 2), (3, 3))
    x, y = np.array([1.03, 2.5]), np.array([2.01, 2.77])
    np.testing.assert_allclose(ground.read(ground.height_m, x, y), 0.2 * x - 0.1 * y, atol=1e-4)
