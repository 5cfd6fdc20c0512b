"""Gaps that sight lines jump over, joined to brims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS

from rover_obstacle_detection.detection.terrain.jumps import (
    Jumps,
    one_in_each_fall,
    whole_brims,
)


@pytest.mark.parametrize(
    ('rows', 'kept'),
    [
        ([5], [5]),
        (range(5, 13), [5]),
        ([*range(5, 13), *range(20, 28)], [5, 20]),
        # Two falls, and three, that follow one another at once.
        (range(5, 19), [5, 11]),
        (range(5, 29), [5, 13, 21]),
    ],
)
def test_one_jump_in_each_fall_is_kept(rows, kept):
    rows = np.array(rows)
    across = np.repeat([3, 4], rows.size)
    found_rows, found_columns = one_in_each_fall(np.tile(rows, 2)[::-1], across[::-1], 8)
    assert found_rows.tolist() == kept * 2
    assert found_columns.tolist() == [3] * len(kept) + [4] * len(kept)


def test_without_jumps_none_is_kept():
    nothing = np.zeros(0, np.intp)
    assert all(each.size == 0 for each in one_in_each_fall(nothing, nothing, 8))


def jumps_at(columns, fall_m=1.0, noise_m=0.0, grazing=0.0):
    """Jumps in one row, 2 m ahead, where a metre has 200 columns."""

    def each(value):
        return np.broadcast_to(np.float32(value), columns.shape)

    rows = np.full(columns.size, 15)
    return Jumps(rows, columns, each(fall_m), each(noise_m), each(grazing), each(2), each(200))


def kept_of(jumps, least_m=0.0, **changes):
    p = replace(PARAMETERS.brims, min_width_share=0.0, **changes)
    return whole_brims(jumps, least_m, (30, 200), p).columns.tolist()


@pytest.mark.parametrize(
    ('columns', 'wide_columns'), [((0, 3), 6), ((1, 3), 6), ((10, 13), 8), ((198, 199), 4)]
)
def test_a_brim_is_as_wide_as_its_columns_and_two_more_on_either_side(columns, wide_columns):
    first, last = columns
    across = np.arange(first, last + 1)
    for share, kept in ((0.99, across.tolist()), (1.01, [])):
        assert kept_of(jumps_at(across), min_width_m=share * wide_columns / 200) == kept


@pytest.mark.parametrize(
    ('columns', 'excess_noises', 'is_found'),
    [(30, 2.9, False), (30, 3.1, True), (128, 1.4, False), (128, 1.6, True)],
)
def test_a_wide_brim_has_less_noise_than_its_pixels(columns, excess_noises, is_found):
    # With two more on either side, 132 columns are four times those that share their noise.
    across = np.arange(20, 20 + columns)
    noise_m = np.where(across % 2, 0.02, 0.04)
    found = kept_of(jumps_at(across, excess_noises * noise_m, noise_m), min_width_m=0.0)
    assert found == (across.tolist() if is_found else [])


@pytest.mark.parametrize(('usual', 'is_found'), [(0.25, True), (0.35, False)])
def test_before_a_brim_the_ground_is_mostly_level(usual, is_found):
    across = np.arange(20, 80)
    grazing = np.where(across % 3 == 0, 0.0, np.where(across % 3 == 1, 0.8, usual))
    found = kept_of(jumps_at(across, grazing=grazing), min_width_m=0.0)
    assert found == (across.tolist() if is_found else [])


def test_brims_apart_are_judged_apart():
    deep, shallow = np.arange(20, 60), np.arange(80, 120)
    jumps = jumps_at(np.concatenate((deep, shallow)), np.repeat([0.1, 0.01], 40), 0.02)
    assert kept_of(jumps, min_width_m=0.0) == deep.tolist()


def test_the_fall_of_a_brim_counts_over_the_least_one():
    across = np.arange(20, 50)
    jumps = jumps_at(across, 0.1, 0.01)
    assert kept_of(jumps, 0.069, min_width_m=0.0) == across.tolist()
    assert kept_of(jumps, 0.071, min_width_m=0.0) == []


def test_pixels_that_noise_could_make_belong_to_no_brim():
    across = np.arange(20, 50)
    noise_m = np.where(across % 2, 0.001, 0.03)
    found = kept_of(jumps_at(across, 0.1, noise_m), 0.08, min_width_m=0.0)
    assert found == across[across % 2 == 1].tolist()
