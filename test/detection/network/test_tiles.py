from __future__ import annotations

import numpy as np
import pytest
from hazard_scenes import HAZARD_SCENES
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.methods.measurement import measure
from rover_obstacle_detection.detection.network.tiles import (
    BLOCK_PX,
    CONTEXT_BLOCKS,
    tiles_around,
)
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.result.parameters import ResultParameters
from rover_obstacle_detection.detection.rocks.outline_features import EVERYWHERE
from rover_obstacle_detection.detection.rocks.rocks import network_outlines, outlined_rocks
from rover_obstacle_detection.detection.rocks.standing import standing_parts

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
    np.testing.assert_array_equal(image[tile.outer][tile.in_outer(tile.inner)], image[tile.inner])


def test_a_tile_grows_as_far_as_it_looks():
    (tile,) = tiles_around(marked_at((200, 300), [(5, 120)]))
    assert tile.grown(10) == (slice(0, 26), slice(102, 138))
    assert tile.grown(50) == tile.outer
    image = np.arange(200 * 300).reshape(200, 300)
    near = tile.grown(10)
    np.testing.assert_array_equal(image[tile.outer][tile.in_outer(near)], image[near])


def test_rims_see_all_that_is_beside_them():
    assert 2 * ResultParameters().rim_reach_px <= CONTEXT_PX


def test_pixels_all_over_the_image_share_one_tile():
    where = np.zeros((400, 400), bool)
    where[::16, ::16] = True
    whole = (slice(0, 400), slice(0, 400))
    assert tiles_around(where) == [(whole, whole)]


def test_tiles_follow_a_diagonal_where_one_would_cover_the_image():
    where = np.eye(800, dtype=bool)
    tiles = tiles_around(where)
    assert len(tiles) >= 4
    assert area(tile.outer for tile in tiles) < 0.5 * where.size


@pytest.mark.parametrize(
    ('bars', 'inner'),
    [
        # Rows and columns of bars, and of the tiles, in blocks. An L: both cuts cost the same.
        (((0, 50, 0, 1), (49, 50, 0, 50)), ((0, 49, 0, 1), (49, 50, 0, 50))),
        # A post on a beam, and beside one.
        (((0, 40, 20, 21), (40, 42, 0, 50)), ((0, 40, 20, 21), (40, 42, 0, 50))),
        (((0, 50, 0, 2), (20, 21, 2, 45)), ((0, 50, 0, 2), (20, 21, 2, 45))),
        # Two groups with an empty margin.
        (((3, 8, 4, 12), (30, 33, 35, 47)), ((3, 8, 4, 12), (30, 33, 35, 47))),
    ],
)
def test_tiles_are_cut_where_that_saves_most(bars, inner):
    where = np.zeros((50 * BLOCK_PX, 50 * BLOCK_PX), bool)
    for top, bottom, left, right in bars:
        where[top * BLOCK_PX : bottom * BLOCK_PX, left * BLOCK_PX : right * BLOCK_PX] = True
    found = [
        tuple(end // BLOCK_PX for part in tile.inner for end in (part.start, part.stop))
        for tile in tiles_around(where)
    ]
    assert sorted(found) == sorted(inner)


@pytest.mark.parametrize(('apart', 'count'), [(5, 1), (6, 2)])
def test_a_gap_is_worth_a_cut_if_it_takes_longer_than_a_call(apart, count):
    # Two squares of 8 blocks side by side: with their context, 10 (18 + apart) blocks and a call,
    # or 100 and a call each.
    where = np.zeros((8 * BLOCK_PX, (16 + apart) * BLOCK_PX), bool)
    where[:, : 8 * BLOCK_PX] = where[:, (8 + apart) * BLOCK_PX :] = True
    assert len(tiles_around(where)) == count


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


@pytest.mark.parametrize('name', ['rock_dome_0.20_wide', 'rock_box_0.15_rover'])
def test_tiles_change_hardly_an_outline(name):
    (scene,) = (each for each in HAZARD_SCENES if each.name == name)
    view = scene.render()
    parameters = DetectorParameters.from_config(DetectorConfig())
    measured = measure(Frame((view.left, view.right), scene.camera), parameters)
    stereo, terrain = measured.stereo, measured.terrain
    standing = standing_parts(terrain, parameters.rocks)
    found = outlined_rocks(stereo, terrain, standing, parameters.rocks).probability
    whole = network_outlines(stereo, terrain, standing, EVERYWHERE, parameters.rocks)
    asked = np.isfinite(found)
    assert 0 < asked.mean() < 0.5
    outlined = whole > 0.5
    assert (outlined & asked).sum() > 100
    # The network was not asked elsewhere, where it outlines nothing.
    assert (outlined & ~asked).sum() < 0.01 * outlined.sum()
    assert ((found > 0.5) != outlined)[asked].sum() < 0.02 * outlined.sum()
