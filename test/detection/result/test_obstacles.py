from __future__ import annotations

import math
from typing import get_args

import numpy as np
import pytest

from rover_obstacle_detection.detection.result.cue import KIND_NUMBERS, KINDS, Cue, Kind
from rover_obstacle_detection.detection.result.obstacles import (
    describe_obstacles,
    main_kinds,
    number_obstacles,
    pixel_kinds,
)

TAIL_SHARE = 0.02


def scene():
    """Pixels a decimetre apart on a wall 2 m away, all 0.2 m high."""
    rows, columns = np.mgrid[0:20, 0:30]
    points = np.stack((columns / 10, rows / 10, np.full_like(columns, 2)), axis=-1)
    mask = np.zeros((20, 30), np.uint8)
    return mask, points.astype(np.float32), np.full((20, 30), 0.2, np.float32)


def find_obstacles(mask, points, height_m):
    numbered = number_obstacles(mask)
    confidence = np.linspace(0.9, 0.1, len(numbered.boxes), dtype=np.float32)
    kinds = ['rock'] * len(numbered.boxes)
    return describe_obstacles(numbered, points, height_m, confidence, kinds, TAIL_SHARE)


def test_empty_mask_has_no_obstacle():
    assert find_obstacles(*scene()) == ()


def test_obstacle_has_its_box_in_the_image_and_in_space():
    mask, points, height = scene()
    mask[3:6, 10:15] = 255
    height[3, 10:15] = 0.35
    (found,) = find_obstacles(mask, points, height)
    assert (found.left, found.top, found.width, found.height, found.pixels) == (10, 3, 5, 3, 15)
    assert found.minimum_m == pytest.approx((1.0, 0.3, 2.0))
    assert found.maximum_m == pytest.approx((1.4, 0.5, 2.0))
    assert found.max_height_m == pytest.approx(0.35)
    assert found.range_m == pytest.approx(math.sqrt(1.0**2 + 0.3**2 + 2.0**2), abs=0.03)


def test_single_mismatches_do_not_stretch_the_box():
    mask, points, height = scene()
    mask[2:12, 5:25] = 255
    points[4, 9], height[4, 9] = (40.0, -30.0, 200.0), 9.0
    points[8, 15], height[8, 15] = (0.0, 0.0, 0.1), -3.0
    (found,) = find_obstacles(mask, points, height)
    assert found.maximum_m == pytest.approx((2.4, 1.1, 2.0), abs=0.05)
    assert found.minimum_m == pytest.approx((0.5, 0.2, 2.0), abs=0.05)
    assert found.max_height_m == pytest.approx(0.2)
    assert found.range_m > 2.0


def test_largest_comes_first():
    mask, points, height = scene()
    mask[1, 1] = 255
    mask[5:9, 5:9] = 255
    mask[12:14, 20:22] = 255
    assert [each.pixels for each in find_obstacles(mask, points, height)] == [16, 4, 1]


def test_pixels_connect_at_corners():
    mask, points, height = scene()
    mask[3, 3] = mask[4, 4] = 255
    (found,) = find_obstacles(mask, points, height)
    assert (found.width, found.height, found.pixels) == (2, 2, 2)


def test_measures_are_of_the_obstacles_own_pixels():
    mask, points, height = scene()
    mask[2:8, 2] = mask[2, 2:8] = 255
    mask[6, 6] = 255
    points[6, 6] = (-9, -9, 0.1)
    height[6, 6] = 5
    large, small = find_obstacles(mask, points, height)
    assert large.max_height_m == pytest.approx(0.2)
    assert large.minimum_m == pytest.approx((0.2, 0.2, 2.0))
    assert small.max_height_m == pytest.approx(5)
    assert small.minimum_m == small.maximum_m == pytest.approx((-9, -9, 0.1))


def test_points_without_depth_do_not_count():
    mask, points, height = scene()
    mask[5:8, 5:8] = 255
    points[5], height[5] = np.nan, np.nan
    (found,) = find_obstacles(mask, points, height)
    assert found.pixels == 9
    assert found.minimum_m == pytest.approx((0.5, 0.6, 2.0))


def test_obstacle_without_depth_has_no_place():
    mask, points, height = scene()
    mask[5:8, 5:8] = 255
    points[:], height[:] = np.nan, np.nan
    (found,) = find_obstacles(mask, points, height)
    assert (found.left, found.top, found.pixels) == (5, 5, 9)
    assert all(map(math.isnan, (*found.minimum_m, *found.maximum_m)))
    assert math.isnan(found.max_height_m)
    assert math.isnan(found.range_m)


def test_obstacles_of_the_same_size_keep_their_order():
    mask, points, height = scene()
    mask[2, 2] = mask[2, 12] = mask[12, 7] = 255
    found = find_obstacles(mask, points, height)
    assert [(each.left, each.top) for each in found] == [(2, 2), (12, 2), (7, 12)]


def test_obstacles_are_numbered_largest_first():
    mask = np.zeros((6, 8), np.uint8)
    mask[0, 0] = 255
    mask[3:6, 2:6] = 255
    mask[0, 6:8] = 255
    numbered = number_obstacles(mask)
    expected = np.zeros((6, 8), int)
    expected[3:6, 2:6], expected[0, 6:8], expected[0, 0] = 1, 2, 3
    np.testing.assert_array_equal(numbered.image, expected)
    np.testing.assert_array_equal(
        numbered.boxes, [[2, 3, 4, 3, 12], [6, 0, 2, 1, 2], [0, 0, 1, 1, 1]]
    )


def test_each_obstacle_has_its_own_confidence_and_kind():
    mask, points, height = scene()
    mask[1, 1] = 255
    mask[5:9, 5:9] = 255
    confidence = np.array([0.75, 0.25], np.float32)
    height[1, 1] = np.nan
    found = describe_obstacles(
        number_obstacles(mask), points, height, confidence, ('slope', 'unmeasured'), TAIL_SHARE
    )
    assert [(each.pixels, each.confidence, each.kind) for each in found] == [
        (16, 0.75, 'slope'),
        (1, 0.25, 'unmeasured'),
    ]


@pytest.mark.parametrize(
    ('shares', 'kind'),
    [
        ({Cue.HEIGHT: 1.0}, 'rock'),
        ({Cue.SLOPE: 0.6, Cue.HEIGHT: 0.5}, 'slope'),
        ({Cue.SLOPE: 0.5, Cue.DROP: 0.7}, 'drop'),
        ({Cue.GREY_LEVEL: 0.8, Cue.HEIGHT: 0.2}, 'unmeasured'),
        ({Cue.ROUGHNESS_STEP: 0.1}, 'rough'),
        ({Cue.HEIGHT: 0.5, Cue.SLOPE: 0.5}, 'rock'),
        ({}, 'rough'),
    ],
    ids=str,
)
def test_an_obstacle_is_what_most_of_its_pixels_are(shares, kind):
    array = np.array([[shares.get(cue, 0.0) for cue in Cue]])
    assert main_kinds(array) == (kind,)


def test_every_cue_makes_a_kind_of_its_own():
    assert set(KINDS) == set(Cue)
    assert sorted(KINDS.values()) == sorted(get_args(Kind))


def test_each_cue_makes_its_kind():
    cues = np.array([[*Cue, 0]], np.uint8)
    numbers = (cues > 0).astype(np.int32)
    found = pixel_kinds(cues, numbers, ['rough'])
    assert found.dtype == np.uint8
    assert found[0].tolist() == [*(KIND_NUMBERS[KINDS[cue]] for cue in Cue), 0]


def test_first_of_several_cues_counts_and_without_any_the_obstacle():
    cues = np.array(
        [[Cue.DROP | Cue.SLOPE, Cue.DROP | Cue.HEIGHT, 0, Cue.DROP, Cue.DROP]], np.uint8
    )
    numbers = np.array([[1, 1, 2, 0, 3]], np.int32)
    kinds = ['drop', 'unmeasured', 'rock']
    assert pixel_kinds(cues, numbers, kinds).tolist() == [[2, 1, 5, 0, 3]]
