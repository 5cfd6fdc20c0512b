from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.rocks.tiles import (
    BLOCK_PX,
    CONTEXT_BLOCKS,
    tiles_around,
)

CONTEXT_PX = CONTEXT_BLOCKS * BLOCK_PX


def marked_at(shape, places):
    where = np.zeros(shape, bool)
    for row, column in places:
        where[row % shape[0], column % shape[1]] = True
    return where


def area(windows):
    return sum(
        (rows.stop - rows.start) * (columns.stop - columns.start) for rows, columns in windows
    )


@given(
    st.tuples(st.integers(1, 150), st.integers(1, 150)),
    st.lists(st.tuples(st.integers(0, 149), st.integers(0, 149)), min_size=1, max_size=6),
)
def test_each_marked_pixel_lies_in_one_tile_with_its_context(shape, places):
    where = marked_at(shape, places)
    covered = np.zeros(shape, int)
    for inner, outer in (tile[:2] for tile in tiles_around(where)):
        covered[inner] += 1
        for inside, outside, size in zip(inner, outer, shape, strict=True):
            assert outside.start == max(inside.start - CONTEXT_PX, 0)
            assert outside.stop == min(-(-inside.stop // BLOCK_PX) * BLOCK_PX + CONTEXT_PX, size)
            assert inside.start % BLOCK_PX == 0
    assert (covered[where] == 1).all()
    assert covered.max() == 1


def test_the_inner_part_is_found_in_the_outer_one():
    image = np.arange(200 * 300).reshape(200, 300)
    (tile,) = tiles_around(marked_at(image.shape, [(100, 120), (130, 150)]))
    assert tile.inner == (slice(96, 144), slice(112, 160))
    assert tile.outer == (slice(80, 160), slice(96, 176))
    np.testing.assert_array_equal(image[tile.outer][tile.inner_in_outer], image[tile.inner])


def test_pixels_all_over_the_image_share_one_tile():
    where = np.zeros((400, 400), bool)
    where[::16, ::16] = True
    whole = (slice(0, 400), slice(0, 400))
    assert tiles_around(where) == [(whole, whole)]


def test_tiles_follow_a_diagonal_where_one_would_cover_the_image():
    where = np.eye(800, dtype=bool)
    tiles = tiles_around(where)
    assert len(tiles) > 4
    assert area(tile.outer for tile in tiles) < 0.5 * where.size


def test_parts_apart_from_each_other_have_tiles_of_their_own():
    places = [(20, 20), (20, 780), (780, 20)]
    tiles = tiles_around(marked_at((800, 800), places))
    assert sorted(tile.inner for tile in tiles) == sorted(
        (
            slice(row // 16 * 16, row // 16 * 16 + 16),
            slice(column // 16 * 16, column // 16 * 16 + 16),
        )
        for row, column in places
    )


def test_parts_beside_each_other_share_a_tile():
    # Two more calls would take longer than the few blocks in between.
    assert len(tiles_around(marked_at((400, 400), [(100, 100), (140, 140)]))) == 1


def test_without_marked_pixels_there_is_no_tile():
    assert tiles_around(np.zeros((40, 60), bool)) == []
