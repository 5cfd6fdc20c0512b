from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.regions.parameters import RegionParameters
from rover_obstacle_detection.detection.regions.segmentation import (
    connected_levels,
    mean_shift_regions,
    merge_small,
    reduced_regions,
)


def flood_fill(image, max_difference):
    """Label pixel by pixel, in reading order."""
    height, width = image.shape
    labels = np.zeros(image.shape, int)
    for start in np.ndindex(image.shape):
        if labels[start]:
            continue
        number = labels.max() + 1
        labels[start] = number
        stack = [start]
        while stack:
            v, u = stack.pop()
            for other in ((v - 1, u), (v + 1, u), (v, u - 1), (v, u + 1)):
                inside = 0 <= other[0] < height and 0 <= other[1] < width
                if not inside or labels[other]:
                    continue
                if abs(int(image[v, u]) - int(image[other])) <= max_difference:
                    labels[other] = number
                    stack.append(other)
    return labels


def same_partition(one, other):
    pairs = {*zip(one.ravel().tolist(), other.ravel().tolist(), strict=True)}
    return len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})


@settings(max_examples=60)
@given(
    image=hnp.arrays(np.uint8, st.tuples(st.integers(1, 7), st.integers(1, 7))),
    max_difference=st.sampled_from([0, 1, 20, 60, 255]),
)
def test_regions_are_those_of_a_flood_fill(image, max_difference):
    labels = connected_levels(image, max_difference)
    assert labels.dtype == np.int32
    assert labels.min() == 1
    assert same_partition(labels, flood_fill(image, max_difference))


def test_diagonal_neighbours_are_not_connected():
    image = np.array([[0, 255], [255, 0]], np.uint8)
    assert len(np.unique(connected_levels(image, 10))) == 4


def test_a_gentle_gradient_is_one_region_and_a_jump_separates():
    image = np.tile(np.arange(0, 200, 4, dtype=np.uint8), (5, 1))
    assert (connected_levels(image, 4) == 1).all()
    image[:, 25:] += 20
    assert len(np.unique(connected_levels(image, 4))) == 2


def test_small_regions_are_merged_into_the_nearest_large_one():
    labels = np.ones((10, 20), np.int32)
    labels[:, 10:] = 2
    labels[4:6, 3:5] = 3
    labels[4:6, 14:16] = 4
    merged = merge_small(labels, 5)
    assert (merged[:, :10] == 1).all()
    assert (merged[:, 10:] == 2).all()
    assert merged.dtype == np.int32


def test_regions_at_the_limit_stay_and_are_renumbered():
    labels = np.array([[1, 2, 2, 3, 3, 3, 3, 4, 5, 5, 5]], np.int32)
    merged = merge_small(labels, 3)
    assert sorted(np.unique(merged)) == [1, 2]
    assert (merged[0, 3:7] == 1).all()
    assert (merged[0, 8:] == 2).all()


def test_all_pixels_are_one_region_if_none_is_large_enough():
    labels = np.arange(1, 13, dtype=np.int32).reshape(3, 4)
    np.testing.assert_array_equal(merge_small(labels, 2), np.ones((3, 4), np.int32))


@settings(max_examples=60)
@given(
    labels=hnp.arrays(
        np.int32,
        st.tuples(st.integers(1, 9), st.integers(1, 9)),
        elements=st.integers(1, 6),
    ),
    min_size=st.integers(1, 20),
)
def test_merged_regions_are_numbered_without_gaps_and_cover_all_pixels(labels, min_size):
    merged = merge_small(labels, min_size)
    count = merged.max()
    assert sorted(np.unique(merged)) == list(range(1, count + 1))
    sizes = np.bincount(labels.ravel())
    for number in np.flatnonzero(sizes >= min_size):
        if number:
            assert len(np.unique(merged[labels == number])) == 1
    assert count == max(np.count_nonzero(sizes[1:] >= min_size), 1)


def test_dark_and_bright_halves_are_separate_regions():
    noise = np.random.default_rng(2).normal(0, 3, (60, 80))
    levels = np.full((60, 80), 20.0)
    levels[:, 40:] = 170
    regions = mean_shift_regions(np.rint(levels + noise).astype(np.uint8), 8, 20, 50)
    assert regions.dtype == np.int32
    assert regions.shape == (60, 80)
    assert len(np.unique(regions[:, :38])) == 1
    assert len(np.unique(regions[:, 42:])) == 1
    assert regions[0, 0] != regions[0, 79]


def test_a_spot_smaller_than_the_limit_is_merged():
    image = np.full((60, 80), 120, np.uint8)
    cv2.circle(image, (40, 30), 10, 30, -1)
    assert len(np.unique(mean_shift_regions(image, 8, 20, 50))) == 2
    assert len(np.unique(mean_shift_regions(image, 8, 20, 1000))) == 1


@pytest.mark.parametrize('level', [0, 128, 255])
def test_uniform_image_is_one_region(level):
    assert (mean_shift_regions(np.full((48, 64), level, np.uint8), 15, 20, 50) == 1).all()


@pytest.mark.parametrize('shape', [(3, 3), (5, 64), (48, 7)])
def test_tiny_images_are_segmented(shape):
    image = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    regions = mean_shift_regions(image, 15, 20, 5)
    assert regions.shape == shape
    assert regions.min() >= 1


def regions_of(grey, **changes):
    return reduced_regions(grey, RegionParameters(**changes), ImageParameters())


def test_reduced_regions_separate_dark_and_bright_halves():
    levels = np.full((96, 130), 40.0)
    levels[:, 64:] = 180
    noise = np.random.default_rng(2).normal(0, 3, levels.shape)
    regions = regions_of(np.rint(levels + noise).astype(np.uint8))
    assert regions.dtype == np.int32
    assert regions.shape == levels.shape
    assert (regions[:, :60] == regions[0, 0]).all()
    assert (regions[:, 70:] == regions[0, -1]).all()
    assert regions[0, 0] != regions[0, -1]


def test_bandwidth_of_reduced_regions_follows_the_texture():
    levels = np.full((96, 128), 100.0)
    levels[:, 64:] = 120
    # Texture four pixels wide, so that the reduction keeps it.
    coarse = np.random.default_rng(2).normal(0, 10, (24, 32))
    texture = np.kron(coarse, np.ones((4, 4)))
    assert len(np.unique(regions_of(levels.astype(np.uint8)))) == 2
    assert len(np.unique(regions_of(np.rint(levels + texture).astype(np.uint8)))) == 1


@pytest.mark.parametrize('shape', [(1, 1), (3, 50), (7, 2)])
def test_reduced_regions_of_tiny_images(shape):
    np.testing.assert_array_equal(regions_of(np.full(shape, 90, np.uint8)), np.ones(shape))


def test_reduced_regions_are_whole_blocks_of_pixels():
    levels = np.random.default_rng(0).integers(0, 256, (6, 16)).astype(np.uint8)
    image = np.kron(levels, np.ones((8, 8), np.uint8))[6:-2, 6:-2]
    regions = regions_of(image)
    assert image.shape == (40, 120)
    assert regions.max() > 5
    np.testing.assert_array_equal(regions, np.kron(regions[::4, ::4], np.ones((4, 4))))


def test_images_smaller_than_a_block_are_reduced_to_one():
    rows = np.repeat(np.array([[0], [0], [240]], np.uint8), 50, axis=1)
    assert (regions_of(rows) == 1).all()
    assert (regions_of(rows.T.copy()) == 1).all()


@pytest.mark.parametrize(('min_size_px', 'stays'), [(1, True), (31, True), (32, False)])
def test_smallest_region_is_given_in_pixels_of_the_full_image(min_size_px, stays):
    image = np.full((32, 32), 60, np.uint8)
    image[8:16, 12:20] = 240
    regions = regions_of(image, min_region_size_px=min_size_px, mean_shift_color_radius=5)
    smallest_px = np.bincount(regions.ravel())[1:].min()
    # A block of the reduced image is 16 pixels.
    assert (smallest_px == 16) == stays
    assert smallest_px >= min_size_px or stays
