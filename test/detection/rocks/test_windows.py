from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rover_obstacle_detection.detection.rocks.windows import (
    BLOCK_PX,
    MARGIN_BLOCKS,
    windows_around,
)


@given(
    st.tuples(st.integers(1, 150), st.integers(1, 150)),
    st.lists(st.tuples(st.integers(0, 149), st.integers(0, 149)), min_size=1, max_size=6),
)
def test_windows_hold_every_marked_pixel_with_its_margin(shape, places):
    where = np.zeros(shape, bool)
    for row, column in places:
        where[row % shape[0], column % shape[1]] = True
    windows = windows_around(where)
    margin = BLOCK_PX * (MARGIN_BLOCKS - 1) + 1
    for row, column in np.argwhere(where):
        assert any(
            rows.start <= max(row - margin, 0)
            and rows.stop >= min(row + margin, shape[0])
            and columns.start <= max(column - margin, 0)
            and columns.stop >= min(column + margin, shape[1])
            for rows, columns in windows
        )
    for window in windows:
        assert where[window].any()
        assert window[0].start % BLOCK_PX == window[1].start % BLOCK_PX == 0


def test_distant_pixels_have_windows_of_their_own():
    where = np.zeros((400, 400), bool)
    where[10, 10] = where[390, 390] = True
    windows = windows_around(where)
    assert len(windows) == 2
    assert sum(where[window].size for window in windows) < 0.1 * where.size


def test_window_has_two_blocks_around_that_of_the_pixel():
    where = np.zeros((400, 410), bool)
    where[127, 159] = True
    assert windows_around(where) == [(slice(80, 160), slice(112, 192))]
    where[127, 159], where[399, 409] = False, True
    assert windows_around(where) == [(slice(352, 400), slice(368, 410))]


def test_windows_of_which_one_holds_the_other_are_one():
    where = np.zeros((400, 400), bool)
    where[100:300, 104] = where[296, 100:300] = where[104, 296] = True
    assert windows_around(where) == [(slice(64, 336), slice(64, 336))]


def test_pixels_all_over_the_image_share_one_window():
    where = np.zeros((400, 400), bool)
    where[::30, ::30] = True
    assert windows_around(where) == [(slice(0, 400), slice(0, 400))]


def test_without_marked_pixels_there_is_no_window():
    assert windows_around(np.zeros((40, 60), bool)) == []
