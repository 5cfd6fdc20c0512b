from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.images.components import (
    components,
    high_holes,
    marked,
    parts_with,
    rows_of_components,
    runs,
    small_parts,
    top_heights,
)


def three_parts():
    """One of three rows, touching corners; one in the first row; one at the end of a row."""
    mask = np.zeros((4, 6), bool)
    mask[0, 4] = mask[1, 0] = mask[2, 1] = mask[3, :3] = mask[2, 4:] = True
    return mask


def test_components_of_a_mask_as_lists():
    pixels, owner, count = components(three_parts())
    assert count == 3
    parts = [pixels[owner == number].tolist() for number in range(count)]
    assert sorted(parts) == [[4], [6, 13, 18, 19, 20], [16, 17]]
    np.testing.assert_array_equal(marked((4, 6), pixels), three_parts())
    rows = rows_of_components(pixels // 6, owner, count)
    assert dict(zip(map(len, parts), rows, strict=True)) == {1: 1, 5: 3, 2: 1}


def test_a_mask_without_pixels_has_no_components():
    pixels, owner, count = components(np.zeros((3, 4), bool))
    assert (pixels.size, owner.size, count) == (0, 0, 0)
    assert not rows_of_components(pixels, owner, count).size


def test_runs_end_with_their_row():
    first, last = runs(three_parts())
    assert list(zip(first, last, strict=True)) == [(4, 4), (6, 6), (13, 13), (16, 17), (18, 20)]


def test_parts_with_a_seed_are_kept_whole():
    mask, seeds = np.zeros((2, 8, 10), bool)
    mask[1:3, 1:4] = mask[3, 4] = mask[5:7, 6:9] = True
    # One on the first part, and one beside both.
    seeds[3, 4] = seeds[0, 9] = True
    expected = mask.copy()
    expected[5:7] = False
    np.testing.assert_array_equal(parts_with(seeds, mask), expected)
    assert not parts_with(seeds, np.zeros_like(mask)).any()


def test_small_parts_have_fewer_pixels_than_the_limit():
    mask = np.zeros((6, 12), bool)
    mask[1, 1:4] = True
    mask[3:5, 6:8] = True
    mask[2, 4] = True
    expected = np.zeros_like(mask)
    assert not small_parts(mask, 4).any()
    expected[1, 1:4] = expected[2, 4] = expected[3:5, 6:8] = True
    np.testing.assert_array_equal(small_parts(mask, 5), expected)


def tops(height, parts, share=0.5):
    found = top_heights(np.array(height, np.float32), np.array(parts, np.int32), share)
    assert found.dtype == np.float32
    return found


def test_top_is_the_mean_of_the_highest_pixels():
    height = [[0.1, 0.4, 0.2, 9.0], [0.3, 0.6, 0.5, -1.0]]
    parts = [[1, 1, 1, 0], [1, 2, 2, 2]]
    np.testing.assert_allclose(tops(height, parts), [0, 0.35, 0.6], rtol=1e-6)
    np.testing.assert_allclose(tops(height, parts, 1.0), [0, 0.25, 0.1 / 3], rtol=1e-5)


def test_top_is_averaged_over_at_least_one_pixel():
    np.testing.assert_allclose(tops([[0.1, 0.4, 0.2]], [[1, 1, 1]], 0.1), [0, 0.4])


def test_components_without_a_pixel_have_height_zero():
    np.testing.assert_allclose(tops([[0.1, 0.4, 0.2]], [[2, 0, 5]]), [0, 0, 0.1, 0, 0, 0.2])
    np.testing.assert_array_equal(tops([[0.1, 0.4]], [[0, 0]]), [0])
    np.testing.assert_array_equal(tops(np.zeros((0, 3)), np.zeros((0, 3))), [0])


def test_top_may_lie_below_the_ground():
    np.testing.assert_allclose(tops([[-0.3, -0.1]], [[1, 1]]), [0, -0.1])


@given(
    parts=st.lists(st.integers(0, 4), min_size=1, max_size=30),
    share=st.floats(0.01, 1),
    seed=st.integers(0, 99),
)
def test_each_component_has_the_top_that_it_has_alone(parts, share, seed):
    height = np.random.default_rng(seed).normal(0, 1, len(parts)).astype(np.float32)
    parts = np.array(parts, np.int32)
    expected = np.zeros(parts.max() + 1)
    for number in set(parts) - {0}:
        own = np.sort(height[parts == number])[::-1]
        expected[number] = own[: max(1, int(len(own) * share))].mean()
    found = top_heights(height[np.newaxis], parts[np.newaxis], share)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def ring(top, bottom, left, right):
    """A frame one pixel wide around a hole."""
    mask = np.zeros((12, 16), bool)
    mask[top : bottom + 1, left : right + 1] = True
    mask[top + 1 : bottom, left + 1 : right] = False
    return mask


def test_only_holes_that_are_high_are_found():
    mask = ring(2, 6, 2, 7) | ring(5, 10, 9, 14)
    height = np.zeros(mask.shape, np.float32)
    height[3:6, 3:7] = 0.2
    height[6:10, 10:14] = 0.04
    expected = np.zeros_like(mask)
    expected[3:6, 3:7] = True
    np.testing.assert_array_equal(high_holes(mask, height, 0.05), expected)
    assert not high_holes(mask, height, 0.25).any()
    assert np.count_nonzero(high_holes(mask, height, 0.03)) == 12 + 16


def test_height_of_a_hole_is_its_mean():
    mask = ring(2, 6, 2, 7)
    height = np.zeros(mask.shape, np.float32)
    height[3, 3:7] = 0.3
    assert high_holes(mask, height, 0.099).any()
    assert not high_holes(mask, height, 0.101).any()


def test_a_hole_is_filled_above_the_limit_only():
    mask, height = ring(2, 6, 2, 7), np.full((12, 16), 0.25, np.float32)
    assert not high_holes(mask, height, 0.25).any()


def test_a_gap_at_a_corner_does_not_open_a_hole():
    mask = ring(2, 6, 2, 7)
    mask[2, 2] = False
    height = np.full(mask.shape, 0.2, np.float32)
    assert np.count_nonzero(high_holes(mask, height, 0.05)) == 12


@pytest.mark.parametrize('edge', [(0, 6, 2, 7), (2, 11, 2, 7), (2, 6, 0, 7), (2, 6, 2, 15)])
def test_background_that_reaches_the_image_border_is_no_hole(edge):
    mask = ring(*edge)
    top, bottom, left, right = edge
    # Remove the side of the frame that lies on the border.
    if top == 0:
        mask[0] = False
    if bottom == 11:
        mask[11] = False
    if left == 0:
        mask[:, 0] = False
    if right == 15:
        mask[:, 15] = False
    assert not high_holes(mask, np.full(mask.shape, 0.2, np.float32), 0.05).any()


@pytest.mark.parametrize('filled', [False, True])
def test_masks_without_a_hole_have_none(filled):
    mask = np.full((5, 6), filled)
    assert not high_holes(mask, np.full((5, 6), 0.2, np.float32), 0.05).any()
