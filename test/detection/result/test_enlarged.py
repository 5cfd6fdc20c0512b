"""Detections at the size of the images, made at a lower resolution."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
from hand_made import small_detection

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.resampling import resized
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import FREE, OBSTACLE
from rover_obstacle_detection.detection.result.enlarged import (
    EnlargedDetection,
    enlarged,
    outlined,
)
from rover_obstacle_detection.detection.result.left_image import in_left_image

SMALL = StereoCamera(64, 48, 60.0, 60.0, 31.5, 23.5, 0.1, cx_right=29.5)
# Twice, 1.5 times, 2.5 times, and no simple ratio, not the same along rows and columns either.
SIZES = [(128, 96), (96, 72), (160, 120), (100, 75), (101, 77)]
TWICE = SMALL.resized(128, 96)
MEASURED = ('height', 'height_noise', 'rock_probability')
OUTLINED = ('cues', 'known', 'mask', 'obstacle_numbers', 'confidence')
PER_PIXEL = (*MEASURED, 'cues', 'known', 'mask')
PINCHED = Correction(RowAlignment(0.5, 0.01), Lenses(LensDistortion(-0.6)))


def frame_of(camera, rover_mask=None):
    random = np.random.default_rng(0)
    left, right = random.integers(0, 255, (2, *camera.shape), dtype=np.uint8)
    return Frame((left, right), camera, excluded=rover_mask)


def scattered(**changes):
    """Many values, and three obstacles whose sides lie at odd and at even pixels."""
    random = np.random.default_rng(1)
    mask = np.zeros(SMALL.shape, np.uint8)
    mask[7:20, 11:26] = OBSTACLE
    mask[30:37, 40:55] = OBSTACLE
    mask[40:47, 3:10] = OBSTACLE
    obstacle = mask == OBSTACLE
    known = random.random(SMALL.shape) < 0.7
    disparity = random.uniform(2.0, 6.0, SMALL.shape).astype(np.float32)
    disparity[random.random(SMALL.shape) < 0.1] = 0
    fields = {
        'mask': mask,
        'cues': np.where(obstacle, random.integers(1, 16, SMALL.shape), 0).astype(np.uint8),
        'known': known | obstacle,
        'disparity': disparity,
        'height': np.where(disparity > 0, obstacle * 0.3, np.nan).astype(np.float32),
        'height_noise': np.where(disparity > 0, 0.01, np.inf).astype(np.float32),
        'rock_probability': np.full(SMALL.shape, np.nan, np.float32),
    }
    return small_detection(SMALL, **{**fields, **changes})


def at(size):
    camera = SMALL.resized(*size)
    frame = frame_of(camera)
    judged = scattered()
    return enlarged(judged, frame), judged, frame


def sources(size):
    """Flat index of the judged pixel whose value each pixel takes."""
    index = np.arange(SMALL.width * SMALL.height, dtype=np.float32).reshape(SMALL.shape)
    found = enlarged(scattered(rock_probability=index), frame_of(SMALL.resized(*size)))
    return found.rock_probability.astype(int)


def beside_no_outline(shape):
    """Pixels whose judged neighbours are all on the same side of an outline."""
    obstacle = (scattered().mask > 0).astype(np.float32)
    share = cv2.resize(obstacle, shape[::-1], interpolation=cv2.INTER_LINEAR)
    return (share == 0) | (share == 1)


def doubled(array):
    return array.repeat(2, axis=0).repeat(2, axis=1)


def test_a_detection_of_that_size_stays_as_it_is():
    judged = scattered()
    assert enlarged(judged, frame_of(SMALL)) is judged


def test_at_twice_the_size_each_pixel_becomes_four():
    found, judged, _ = at((128, 96))
    for name in (*MEASURED, *OUTLINED):
        own, expected = getattr(found, name), getattr(judged, name)
        assert own.dtype == expected.dtype, name
        np.testing.assert_array_equal(own, doubled(expected), name)
    for own, expected in zip(found.rims, judged.rims, strict=True):
        np.testing.assert_array_equal(own, doubled(expected))
    np.testing.assert_array_equal(found.disparity, 2 * doubled(judged.disparity))


@pytest.mark.parametrize('size', SIZES)
def test_each_pixel_takes_the_values_of_one_judged_pixel_the_nearest(size):
    found, judged, _ = at(size)
    index = sources(size)
    for number, along, scaled in ((0, SMALL.height, size[1]), (1, SMALL.width, size[0])):
        source = np.unravel_index(index, SMALL.shape)[number]
        place = (np.indices(index.shape)[number] + 0.5) * along / scaled - 0.5
        assert np.abs(place - source).max() <= 0.501
    assert index.shape == found.camera.shape
    for name in MEASURED:
        own = getattr(found, name)
        np.testing.assert_array_equal(own, getattr(judged, name).ravel()[index], name)
    for name in OUTLINED:
        off = getattr(found, name) != getattr(judged, name).ravel()[index]
        assert not off[beside_no_outline(found.camera.shape)].any(), name
    for own, expected in zip(found.rims, judged.rims, strict=True):
        np.testing.assert_array_equal(own, expected.ravel()[index])


@pytest.mark.parametrize('size', SIZES)
@pytest.mark.parametrize('asked', [False, True])
def test_outlined_pixels_are_obstacles_in_every_respect(size, asked):
    changes = {}
    if asked:
        random = np.random.default_rng(2)
        changes['rock_probability'] = random.random(SMALL.shape, np.float32)
    found = enlarged(scattered(**changes), frame_of(SMALL.resized(*size)))
    obstacle = found.mask == OBSTACLE
    for array in (found.cues, found.obstacle_numbers, found.confidence):
        np.testing.assert_array_equal(array > 0, obstacle)
    assert found.known[obstacle].all()
    # What is left out of an obstacle is unknown.
    index = sources(size)
    left_out = (scattered().mask.ravel()[index] > 0) & ~obstacle
    assert left_out.any() or not asked
    assert not found.known[left_out].any()


def test_outline_runs_where_the_interpolated_probability_reaches_the_limit():
    mask = np.zeros(SMALL.shape, np.uint8)
    mask[:, :8] = OBSTACLE
    # From 0.9 to 0.3 in one pixel: 0.5 is two thirds of the way.
    probability = np.where(mask > 0, 0.9, 0.3).astype(np.float32)
    for limit, share in ((0.5, 2 / 3), (0.75, 1 / 4)):
        parameters = DetectorParameters.from_config(DetectorConfig(outline_probability=limit))
        judged = scattered(mask=mask, rock_probability=probability, parameters=parameters)
        found = outlined(judged, (SMALL.height, 60 * SMALL.width))
        # Pixel centres of the judged columns 7 and 8 lie 7.5 and 8.5 columns from the side.
        np.testing.assert_allclose(found.sum(axis=1), (7.5 + share) * 60, atol=1)


def test_unasked_outlines_run_half_way():
    found = outlined(scattered(), (960, 1280))
    np.testing.assert_array_equal(found[150:390, 230:510].any(0), True)
    middle = found[270]
    assert np.flatnonzero(middle)[[0, -1]].tolist() == [220, 519]


def test_an_obstacle_that_the_network_does_not_see_stays_one():
    probability = np.zeros(SMALL.shape, np.float32)
    found = enlarged(scattered(rock_probability=probability), frame_of(TWICE))
    np.testing.assert_array_equal(found.mask, doubled(scattered().mask))
    assert all(each.pixels for each in found.obstacles)
    # And what it sees where other stages found nothing is none.
    found = enlarged(scattered(rock_probability=probability + 1), frame_of(TWICE))
    np.testing.assert_array_equal(found.mask, doubled(scattered().mask))


@pytest.mark.parametrize('probability', [0.0, 0.45, np.nan])
@pytest.mark.parametrize('size', SIZES)
def test_an_obstacle_of_one_row_stays_one(size, probability):
    mask = np.zeros(SMALL.shape, np.uint8)
    mask[20, 10:50] = OBSTACLE
    seen = np.full(SMALL.shape, probability, np.float32)
    found = outlined(scattered(mask=mask, rock_probability=seen), size[::-1])
    area = np.count_nonzero(mask) * found.size / mask.size
    assert np.count_nonzero(found) > 0.6 * area


@pytest.mark.parametrize('limit', [0.1, 0.5, 0.9])
def test_no_obstacle_grows_into_what_is_not_judged(limit):
    mask = np.zeros(SMALL.shape, np.uint8)
    mask[:, 20:40] = OBSTACLE
    probability = np.where(mask > 0, 1, np.nan).astype(np.float32)
    parameters = DetectorParameters.from_config(DetectorConfig(outline_probability=limit))
    judged = scattered(mask=mask, rock_probability=probability, parameters=parameters)
    for factor in (2, 3, 7):
        found = outlined(judged, (factor * SMALL.height, factor * SMALL.width))
        assert not found[:, : 20 * factor].any()
        assert not found[:, 40 * factor :].any()


@pytest.mark.parametrize('size', SIZES)
def test_disparity_is_in_pixels_of_the_full_image(size):
    found, judged, frame = at(size)
    expected = judged.disparity.ravel()[sources(size)] * size[0] / SMALL.width
    np.testing.assert_allclose(found.disparity, expected, rtol=1e-6)
    assert found.disparity.dtype == np.float32
    assert found.camera is frame.camera


@pytest.mark.parametrize('size', SIZES)
def test_points_are_those_of_the_judged_pixel_on_the_own_ray(size):
    found, judged, _ = at(size)
    expected = judged.points.reshape(-1, 3)[sources(size)]
    points = found.points
    assert points.shape == (*found.camera.shape, 3)
    assert points.dtype == np.float32
    np.testing.assert_allclose(points[..., 2], expected[..., 2], rtol=1e-5)
    half_m = 0.501 * expected[..., 2] / SMALL.fx
    apart_m = np.abs(points - expected)
    measured = judged.disparity.ravel()[sources(size)] > 0
    np.testing.assert_array_equal(np.isfinite(points).all(-1), measured)
    for axis in (0, 1):
        assert (apart_m[..., axis][measured] <= half_m[measured]).all()
    x, y = (np.broadcast_to(each, found.camera.shape) for each in found.camera.rays())
    np.testing.assert_allclose(points[..., 0], x * points[..., 2], rtol=1e-5)
    np.testing.assert_allclose(points[..., 1], y * points[..., 2], rtol=1e-5)


@pytest.mark.parametrize('size', SIZES)
def test_boxes_fit_the_pixels_of_their_obstacles(size):
    found, judged, _ = at(size)
    assert len(found.obstacles) == len(judged.obstacles) == 3
    for number, (each, small) in enumerate(zip(found.obstacles, judged.obstacles, strict=True), 1):
        rows, columns = np.nonzero(found.obstacle_numbers == number)
        assert (each.left, each.left + each.width - 1) == (columns.min(), columns.max())
        assert (each.top, each.top + each.height - 1) == (rows.min(), rows.max())
        assert each.pixels == len(rows)
        for name in ('minimum_m', 'maximum_m', 'max_height_m', 'range_m', 'confidence', 'kind'):
            assert getattr(each, name) == getattr(small, name), name
    np.testing.assert_array_equal(found.obstacle_numbers > 0, found.mask == OBSTACLE)


def test_clouds_are_those_of_the_judged_pixels():
    found, judged, _ = at((160, 120))
    np.testing.assert_array_equal(found.obstacle_points, judged.obstacle_points)
    np.testing.assert_array_equal(found.ground_points, judged.ground_points)
    assert found.grid is judged.grid
    assert found.obstacle_point_kinds is judged.obstacle_point_kinds
    assert len(found.obstacle_point_kinds) == len(found.obstacle_points)
    assert found.obstacle_point_kinds.all()
    assert 200 < len(found.obstacle_points) <= np.count_nonzero(judged.mask)
    assert 100 < len(found.ground_points) < np.count_nonzero(judged.mask == FREE)


def test_grey_image_is_the_given_left_image():
    found, _, frame = at((100, 75))
    np.testing.assert_array_equal(found.grey, frame.pair[0])


def test_what_does_not_depend_on_the_size_is_kept():
    judged = scattered(warnings=('dark',))
    found = enlarged(judged, frame_of(TWICE))
    assert isinstance(found, EnlargedDetection)
    assert found.judged is judged
    assert found.ground is judged.ground
    assert found.parameters is judged.parameters
    assert found.config is judged.config
    assert found.warnings == ('dark',)
    assert found.evidence is judged.evidence


def test_rows_of_the_correction_are_in_pixels_of_the_full_image():
    found = enlarged(scattered(correction=PINCHED), frame_of(TWICE))
    assert found.alignment == RowAlignment(1.0, 0.01)
    assert found.lenses == PINCHED.lenses


def test_study_products_are_of_the_full_size():
    found = enlarged(small_detection(SMALL), frame_of(TWICE))
    roughness = found.roughness
    assert roughness.shape == found.step.shape == (96, 128)
    np.testing.assert_array_equal(found.study.grey, found.grey)
    np.testing.assert_array_equal(found.study.disparity, found.disparity)
    # On a surface of constant depth, windows are flat and steps follow from the pixel's size.
    level = found.study.step[80:90, 10:40]
    pixel_m = found.camera.depth_m(6.0) / found.camera.fy
    rise = found.ground.up[1]
    np.testing.assert_allclose(level, 4 * pixel_m * abs(rise), rtol=0.01)


def test_rover_is_not_judged():
    rover = np.zeros(TWICE.shape, bool)
    rover[65:, 80:95] = True  # cuts the obstacle in rows 60 to 73, columns 80 to 109
    judged = scattered()
    found = enlarged(judged, frame_of(TWICE, rover))
    for name in ('mask', 'cues', 'known', 'obstacle_numbers', 'confidence'):
        assert not getattr(found, name)[rover].any(), name
        expected = doubled(getattr(judged, name))[~rover]
        np.testing.assert_array_equal(getattr(found, name)[~rover], expected, name)
    number = found.obstacle_numbers[62, 100]
    cut = found.obstacles[number - 1]
    rows, columns = np.nonzero(found.obstacle_numbers == number)
    assert cut.pixels == len(rows) == 14 * 30 - 9 * 15
    assert cut.left <= columns.min() <= columns.max() < cut.left + cut.width
    assert cut.top <= rows.min() <= rows.max() < cut.top + cut.height


def test_an_obstacle_that_the_rover_hides_has_no_pixels():
    rover = np.zeros(TWICE.shape, bool)
    rover[80:94, 6:20] = True
    found = enlarged(scattered(), frame_of(TWICE, rover))
    assert [each.pixels for each in found.obstacles] == [4 * 13 * 15, 4 * 7 * 15, 0]
    hidden = found.obstacles[-1]
    assert (hidden.left, hidden.top, hidden.width, hidden.height) == (6, 80, 14, 14)


def test_pixels_of_a_distorting_lens_lie_on_the_straight_rays():
    straight = scattered(correction=PINCHED)
    judged = in_left_image(straight, frame_of(SMALL))
    found = enlarged(judged, frame_of(TWICE))
    np.testing.assert_array_equal(found.points, doubled(judged.points))
    unseen = ~doubled(judged.remapping.shown)
    assert 0 < unseen.sum() < unseen.size / 2
    assert np.isnan(found.points[unseen]).all()
    assert not found.disparity[unseen].any()
    assert not found.known[unseen].any()
    # A pixel half way to the border shows what a straight lens shows farther out.
    x, _, z = found.points[40:56, 96].T
    assert np.nanmedian(x / z) > 1.05 * (96 - TWICE.cx) / TWICE.fx
    np.testing.assert_array_equal(found.mask, doubled(judged.mask))
    assert found.obstacles


@pytest.mark.parametrize('correction', [Correction(), PINCHED])
def test_all_arrays_are_read_only(correction):
    judged = in_left_image(scattered(correction=correction), frame_of(SMALL))
    found = enlarged(judged, frame_of(TWICE))
    names = (*PER_PIXEL, 'grey', 'disparity', 'points', 'obstacle_numbers', 'confidence')
    names += ('kinds', 'obstacle_points', 'obstacle_point_kinds', 'ground_points')
    for name in (*names, 'roughness', 'step'):
        array = getattr(found, name)
        with pytest.raises(ValueError, match='read-only'):
            array[0] = 0
    for array in found.rims:
        with pytest.raises(ValueError, match='read-only'):
            array[0] = True


def test_judged_detection_is_not_modified():
    judged = scattered()
    copies = {name: getattr(judged, name).copy() for name in (*PER_PIXEL, 'disparity', 'grey')}
    found = enlarged(judged, frame_of(TWICE, np.ones(TWICE.shape, bool)))
    assert not found.mask.any()
    for name, copy in copies.items():
        np.testing.assert_array_equal(getattr(judged, name), copy, name)


def test_fields_can_be_replaced():
    found, judged, _ = at((128, 96))
    changed = dataclasses.replace(found, warnings=('dark',))
    assert changed.warnings == ('dark',)
    assert changed.judged is judged
    np.testing.assert_array_equal(changed.mask, found.mask)
    assert changed.obstacles == found.obstacles
    empty = dataclasses.replace(found, mask=np.zeros(TWICE.shape, np.uint8))
    assert not empty.obstacle_numbers.any()


@pytest.mark.parametrize(
    'array',
    [
        np.array([[True, False, True]]),
        np.array([[0, 128, 255]], np.uint8),
        np.array([[-5, 0, 2**30 + 1]], np.int32),
        np.array([[np.nan, np.inf, 0.1]], np.float32),
    ],
    ids=lambda array: str(array.dtype),
)
def test_resized_keeps_types_and_values(array):
    array.flags.writeable = False
    found = resized(array, (2, 6))
    assert found.dtype == array.dtype
    np.testing.assert_array_equal(found, array.repeat(2, axis=1).repeat(2, axis=0))
    found[:] = 0  # a copy


def test_slopes_and_drops_keep_their_kind():
    cues = np.zeros(SMALL.shape, np.uint8)
    cues[7:20, 11:26], cues[30:37, 40:55], cues[40:47, 3:10] = Cue.SLOPE, Cue.DROP, Cue.HEIGHT
    found = enlarged(scattered(cues=cues), frame_of(SMALL.resized(100, 75)))
    assert [each.kind for each in found.obstacles] == ['slope', 'drop', 'rock']
