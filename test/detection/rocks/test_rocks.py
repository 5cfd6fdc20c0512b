from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from relief import PosedCamera, block, flat

from rover_obstacle_detection.detection.network.tiles import BLOCK_PX, Tile
from rover_obstacle_detection.detection.rocks import rocks
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.rocks import Rocks, outlined_rocks
from rover_obstacle_detection.detection.rocks.standing import standing_parts
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.survey import survey

POSED = PosedCamera(pitch_deg=40.0, height_m=1.2)
ROCK = block(0.0, 1.4, 0.3, 0.25)
PARAMETERS = RockParameters(max_step_m=0.1)


class Drawing:
    """A network that outlines what stands up, with one probability, and records its windows."""

    def __init__(self, probability, unmeasured=False):
        self.probability = probability
        self.unmeasured = unmeasured
        self.windows = []

    def __call__(self, stereo, terrain, standing, window, parameters):
        self.windows.append(window)
        drawn = standing.parts[window] > 0
        if self.unmeasured:
            drawn |= ~terrain.measured[window]
        return np.where(drawn, self.probability, 0).astype(np.float32)


@cache
def seen_disparity(height):
    return POSED.look(height)[0]


def find(height, draw, *, unmatched=None, parameters=PARAMETERS):
    disparity = seen_disparity(height).copy()
    if unmatched:
        disparity[unmatched] = 0
    stereo = POSED.stereo(disparity)
    terrain = survey(stereo, TerrainParameters(max_step_m=parameters.max_step_m))
    standing = standing_parts(terrain, parameters)
    return outlined_rocks(stereo, terrain, standing, parameters, draw), standing.parts > 0


def test_outlined_rock_is_too_high():
    draw = Drawing(0.9)
    found, stands = find(ROCK, draw)
    assert stands.sum() > 100
    np.testing.assert_array_equal(found.high, stands)
    assert (found.probability[stands] == np.float32(0.9)).all()


def test_rock_that_is_not_outlined_is_no_obstacle():
    found, stands = find(ROCK, Drawing(0.4))
    assert stands.any()
    assert not found.high.any()
    lower = replace(PARAMETERS, outline_probability=0.3)
    found, _ = find(ROCK, Drawing(0.4), parameters=lower)
    assert found.high.any()


def test_pixels_that_the_network_does_not_rule_out():
    rocks = Rocks(np.zeros((1, 4), bool), np.float32([[np.nan, 0.2, 0.25, 1]]))
    found = rocks.possible(replace(PARAMETERS, free_probability=0.25))
    assert found.tolist() == [[False, False, True, True]]


def test_network_sees_only_the_surroundings_of_what_stands_up():
    draw = Drawing(0.9)
    found, stands = find(ROCK, draw)
    seen = np.zeros(stands.shape, bool)
    for window in draw.windows:
        seen[window] = True
    asked = np.isfinite(found.probability)
    assert asked[stands].all()
    assert seen[asked].all()
    assert seen.mean() < 0.5


def test_outlines_may_reach_a_few_pixels_beyond_what_stands_up():
    class Wide(Drawing):
        def __call__(self, *args):
            return np.full_like(super().__call__(*args), self.probability)

    found, stands = find(ROCK, Wide(0.9))
    reach = PARAMETERS.outline_reach_px
    around = cv2.dilate(stands.astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0
    assert found.high[around].all()


def test_a_rock_across_two_tiles_is_judged_as_one(monkeypatch):
    _, stands = find(ROCK, Drawing(0.9))
    columns = np.flatnonzero(stands.any(axis=0))
    # The left half alone would have too few measured pixels to be an obstacle.
    hidden = np.s_[:, columns[0] : (columns[0] + columns[-1]) // 2]
    expected, _ = find(ROCK, Drawing(0.9, unmeasured=True), unmatched=hidden)
    middle = (columns[0] + columns[-1]) // 2 // BLOCK_PX * BLOCK_PX
    halves = [np.s_[:, :middle], np.s_[:, middle:]]

    def in_halves(where):
        height, width = where.shape
        bounds = ((slice(0, height), slice(0, middle)), (slice(0, height), slice(middle, width)))
        return [Tile(each, each) for each in bounds]

    monkeypatch.setattr(rocks, 'tiles_around', in_halves)
    found, _ = find(ROCK, Drawing(0.9, unmeasured=True), unmatched=hidden)
    assert all(found.high[half].any() for half in halves)
    np.testing.assert_array_equal(found.high & (expected.probability > 0), expected.high)


def test_network_sees_nothing_of_flat_ground():
    draw = Drawing(0.9)
    found, _ = find(flat, draw)
    assert draw.windows == []
    assert np.isnan(found.probability).all()
    assert not found.high.any()


def test_ground_without_3d_is_left_alone():
    draw = Drawing(0.9)
    found, _ = find(flat, draw, unmatched=np.s_[60:110, 80:130])
    assert draw.windows == []
    assert not found.high.any()


def shadowed(gap):
    """The rock of this module with an area without 3D beside it, and what is drawn of it."""
    draw = Drawing(0.9, unmeasured=True)
    found, stands = find(ROCK, draw, unmatched=gap)
    assert stands.any()
    seen = np.zeros(stands.shape, bool)
    for window in draw.windows:
        seen[window] = True
    return found, stands, seen


def test_network_sees_the_areas_without_3d_beside_what_stands_up():
    _, whole = find(ROCK, Drawing(0.9))
    rows, columns = np.nonzero(whole)
    beside = np.s_[rows.min() : rows.max(), columns.max() + 1 : columns.max() + 40]
    found, stands, seen = shadowed(beside)
    assert seen[beside].all()
    # The dark side belongs to the rock, as the network outlines both.
    assert found.high[beside].all()
    assert found.high[stands].all()


@pytest.mark.parametrize(('rows', 'expected'), [(8, False), (16, True)])
def test_network_is_not_shown_small_gaps(rows, expected):
    _, whole = find(ROCK, Drawing(0.9))
    middle = round(np.flatnonzero(whole.any(axis=1)).mean())
    left = whole.any(axis=0).argmax()
    gap = np.s_[middle - rows // 2 : middle + rows // 2, left - 40 : left]
    _, _, seen = shadowed(gap)
    assert seen[gap][:, 0].any() == expected


@pytest.mark.parametrize(('rim', 'expected'), [(4, True), (5, False)])
def test_dark_sides_may_lie_a_few_pixels_beside_what_stands_up(rim, expected):
    _, whole = find(ROCK, Drawing(0.9))
    middle = round(np.flatnonzero(whole.any(axis=1)).mean())
    left = whole.any(axis=0).argmax()
    gap = np.s_[middle - 8 : middle + 8, left - rim - 40 : left - rim]
    _, stands, seen = shadowed(gap)
    assert stands.any(axis=0).argmax() == left
    assert seen[gap][:, 0].any() == expected


def test_network_is_asked_about_the_near_part_of_a_large_area_without_3d():
    _, whole = find(ROCK, Drawing(0.9))
    rows, columns = np.nonzero(whole)
    row, last = round(rows.mean()), columns.max()
    found, _, _ = shadowed(np.s_[rows.min() : rows.max(), last + 1 :])
    asked = np.isfinite(found.probability[row])
    reach = PARAMETERS.dark_side_px
    assert asked[last : last + reach + 1].all()
    assert not asked[last + reach + BLOCK_PX + 1 :].any()
    assert asked.size > last + reach + BLOCK_PX + 1


def test_network_does_not_see_areas_without_3d_elsewhere():
    _, whole = find(ROCK, Drawing(0.9))
    away = np.s_[:40, :40]
    assert not whole[:60, :60].any()
    _, _, seen = shadowed(away)
    assert not seen[:20, :20].any()


def test_network_is_overruled_where_something_high_is_upright():
    found, stands = find(block(0.0, 1.4, 0.06, 0.5), Drawing(0.1))
    overruled = found.probability == 1
    assert overruled.sum() > 40
    assert found.high[overruled].all()
    assert not found.high[~stands].any()
