from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, bank, block, flat, terrain_of, tilted, together

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain import hazards as module
from rover_obstacle_detection.detection.terrain.cell_evidence import cell_evidence
from rover_obstacle_detection.detection.terrain.elevation_map import map_positions
from rover_obstacle_detection.detection.terrain.hazards import (
    dropping_ground,
    large_slopes,
    rough_ground,
    steep_ground,
    tall,
)
from rover_obstacle_detection.detection.terrain.terrain import Layer

POSED = PosedCamera(pitch_deg=40.0, height_m=1.5)


def judged(height, ground=POSED.level_ground, noise_px=0.02, **parameters):
    """Steep and dropping ground, and the measured x and y of each pixel."""
    parameters = replace(PARAMETERS, **parameters)
    terrain, _, x, y = POSED.survey(height, noise_px, ground, parameters)
    cells = cell_evidence(terrain, ground, parameters)
    steep = steep_ground(terrain, cells, ground, parameters)
    dropped = dropping_ground(terrain, cells, parameters)
    assert not (steep.found | dropped.found)[~terrain.measured].any()
    return steep, dropped, *(np.where(terrain.measured, place, np.nan) for place in (x, y))


def surveyed(*args, **options):
    """The same, only what is found."""
    steep, dropped, x, y = judged(*args, **options)
    return steep.found, dropped.found, x, y


@pytest.mark.parametrize('limit', [2, 5, 20])
def test_slope_limit_may_be_small(limit):
    steep, _, _, y = surveyed(bank(26, 0.0), max_slope_deg=limit)
    assert steep[(y > 0.8) & (y < 1.6)].mean() > 0.9


def test_flat_ground_is_neither_steep_nor_dropping():
    steep, dropped, *_ = surveyed(flat)
    assert not steep.any()
    assert not dropped.any()


@pytest.mark.parametrize(('angle', 'flagged'), [(26, 1), (22, 1), (18, 0), (12, 0)])
@pytest.mark.parametrize('sign', [1, -1], ids=['up', 'down'])
def test_slope_ahead_is_steep_beyond_the_limit(angle, flagged, sign):
    steep, _, _, y = surveyed(bank(sign * angle, 2.0))
    assert steep[(y > 2.5) & (y < 5)].mean() == pytest.approx(flagged, abs=0.05)
    assert not steep[(y > 0.2) & (y < 1.6)].any()


@pytest.mark.parametrize(
    ('angle', 'noise_px', 'share'), [(21, 0.02, 1), (21, 0.3, 0), (26, 0.3, 1)]
)
def test_a_slope_that_noise_could_make_is_only_possible(angle, noise_px, share):
    slopes, _, _, y = judged(bank(angle, 1.5), noise_px=noise_px)
    on_slope = (y > 2.0) & (y < 2.6)
    assert slopes.found[on_slope].mean() == pytest.approx(share, abs=0.1)
    assert slopes.possible[on_slope].mean() > 0.9


@pytest.mark.parametrize(('angle', 'flagged'), [(26, 1), (-26, 1), (12, 0), (-12, 0)])
def test_slope_to_the_side_is_steep_beyond_the_limit(angle, flagged):
    steep, _, _, y = surveyed(tilted(rise_x=math.tan(math.radians(angle))))
    assert steep[y < 4].mean() == pytest.approx(flagged, abs=0.05)


@pytest.mark.parametrize(('limit', 'flagged'), [(10.0, 1), (30.0, 0)])
def test_slope_limit_is_a_parameter(limit, flagged):
    steep, _, _, y = surveyed(bank(20, 2.0), max_slope_deg=limit)
    assert steep[(y > 2.5) & (y < 5)].mean() == pytest.approx(flagged, abs=0.05)


def test_slope_is_measured_against_the_vertical():
    up = Gravity.from_angles(POSED.pitch_deg - 12).up
    ground = GroundPlane(POSED.up, POSED.height_m, up)
    # The ground plane rises by 12 degrees ahead of this vertical's horizontal.
    assert ground.slope_deg == pytest.approx(12)
    for angle, flagged in ((12, 1), (5, 0), (-26, 0)):
        steep, _, _, y = surveyed(bank(angle, 2.0), ground=ground)
        assert steep[(y > 2.5) & (y < 5)].mean() == pytest.approx(flagged, abs=0.05)


def test_rocks_are_neither_steep_nor_dropping():
    steep, dropped, *_ = surveyed(together(block(0, 2, 0.4, 0.3), block(0.8, 3, 0.5, 0.4)))
    assert steep.mean() < 0.005
    assert not dropped.any()


def test_what_a_rover_with_a_high_step_can_cross_is_not_steep():
    rocks = together(block(0, 2, 0.3, 0.2), block(0.8, 3, 0.4, 0.15))
    steep, *_ = surveyed(rocks, max_step_m=0.25)
    assert steep.mean() < 0.001
    # A ledge is, although it is measured as finely.
    steep, _, _, y = surveyed(lambda x, y: 0.4 * (y > 2), max_step_m=0.25)
    assert steep[np.abs(y - 2) < 0.05].mean() > 0.9


@pytest.mark.parametrize(('depth', 'found'), [(0.3, 1), (0.08, 0)])
def test_pit_drops_away(depth, found):
    _, dropped, x, y = surveyed(block(0.0, 2.0, 0.8, -depth))
    inner = np.maximum(abs(x), abs(y - 2)) < 0.35
    assert np.count_nonzero(inner) > 100
    assert dropped[inner].mean() == pytest.approx(found, abs=0.1)
    assert not dropped[np.maximum(abs(x), abs(y - 2)) > 0.5].any()


def test_pit_may_be_as_deep_as_a_step():
    _, dropped, *_ = surveyed(block(0.0, 2.0, 0.8, -0.3), max_step_m=0.4)
    assert not dropped.any()


def test_flat_ground_is_possibly_neither():
    steep, dropped, _, y = judged(flat)
    assert not steep.possible[y < 5].any()
    assert not dropped.possible[y < 5].any()


@pytest.mark.parametrize(('angle', 'possible'), [(12, 0), (18, 1)])
def test_slope_just_below_the_limit_is_possible(angle, possible):
    steep, _, _, y = judged(bank(angle, 2.0))
    assert not steep.found.any()
    # At the sides of the map, the rise is known less.
    assert steep.possible[(y > 2.5) & (y < 4)].mean() == pytest.approx(possible, abs=0.05)


def test_a_ledge_is_possible_where_only_a_wide_scale_shows_the_ground():
    # Twice as high as the step. With so much noise, it is smoothed to less than the limit.
    def ledge(x, y):
        return 0.2 * (y > 3)

    for noise_px, found in ((0.02, True), (0.5, False)):
        steep, _, _, y = judged(ledge, noise_px=noise_px)
        at_ledge = np.abs(y - 3) < 0.05
        assert at_ledge.sum() > 100
        assert steep.possible[at_ledge].mean() > 0.95
        assert steep.found[at_ledge].any() == found


def test_slope_is_possible_as_far_beside_it_as_it_is_smoothed():
    steep, _, _, y = judged(bank(30, 2.0))
    before_m = np.where(steep.found, np.nan, 2.0 - y)
    beside = before_m[steep.possible & (y < 2)]
    assert 0.1 < np.nanmax(beside) < 0.4
    assert steep.possible[steep.found].all()


@pytest.mark.parametrize(
    ('depth', 'noise_px', 'possible'), [(0.05, 0.02, 0), (0.08, 0.02, 0), (0.08, 0.2, 1)]
)
def test_hollow_is_possible_within_two_deviations_of_noise(depth, noise_px, possible):
    _, dropped, x, y = judged(block(0.0, 2.0, 0.8, -depth), noise_px=noise_px)
    inner = np.maximum(abs(x), abs(y - 2)) < 0.3
    assert not dropped.found[inner].any()
    assert dropped.possible[inner].mean() == pytest.approx(possible, abs=0.1)


def test_low_ground_beside_a_hollow_is_possible_where_its_rim_is_too_far():
    def low_ground_with_a_notch(x, y):
        notch = (abs(x) < 0.4) & (abs(y - 2) < 0.4)
        return np.where(notch | ((x < -0.3) & (y > 1.0) & (y < 5)), -0.3, 0.0)

    _, dropped, x, y = judged(low_ground_with_a_notch)
    notch = (abs(x) < 0.2) & (abs(y - 2) < 0.2)
    assert dropped.found[notch].mean() > 0.9
    beside = (x > -0.8) & (x < -0.5) & (abs(y - 2) < 0.2)
    assert beside.sum() > 20
    assert (dropped.found | dropped.possible)[beside].all()
    # Level ground there is as high as the rim.
    assert not dropped.possible[(x > 0.6) & (x < 1.2) & (abs(y - 2) < 0.4)].any()
    # Away from what is found, low ground is as far below as everything around it.
    far = (x < -1.0) & (y > 3.5) & (y < 4.0)
    assert far.sum() > 20
    assert not dropped.possible[far].any()


def test_hollow_of_two_small_steps_is_possible():
    _, dropped, x, y = judged(block(0.0, 2.0, 0.8, -0.02), max_step_m=0.01)
    inner = np.maximum(abs(x), abs(y - 2)) < 0.3
    assert (dropped.possible | dropped.found)[inner].mean() > 0.6


@pytest.mark.parametrize('step_m', [0.1, 0.05])
def test_hollow_shallower_than_relief_or_half_a_step_is_ruled_out_whatever_the_noise(step_m):
    _, dropped, *_ = judged(block(0.0, 2.0, 0.8, -0.02), noise_px=0.3, max_step_m=step_m)
    assert not dropped.possible.any()


@pytest.mark.parametrize('height', [bank(26, 2.0), block(0.0, 2.0, 0.8, -0.3)])
def test_noise_above_a_step_hides_slopes_and_drops(height):
    quiet = np.logical_or(*surveyed(height)[:2])
    assert quiet.any()
    noisy = np.logical_or(*surveyed(height, noise_px=2.0)[:2])
    assert not noisy.any()


def test_pit_must_be_deeper_than_a_step_and_noise():
    # 5 cm deeper than a step, which is less than two standard deviations of the height.
    pit = block(0.0, 2.0, 0.8, -0.15)
    assert surveyed(pit)[1].any()
    assert not surveyed(pit, noise_px=0.4)[1].any()


@pytest.mark.parametrize(('radius', 'width'), [(0.2, 1), (0.9, 3), (1.2, 3), (2.0, 5), (2.4, 5)])
def test_cells_are_dilated_by_whole_cells(radius, width):
    one = np.zeros((15, 15), bool)
    one[7, 7] = True
    found = module._dilated(one, radius)
    for middle in (found[7], found[:, 7]):
        assert np.flatnonzero(middle).tolist() == list(range(7 - width // 2, 8 + width // 2))


def slope_with(*gaps):
    steep = np.zeros((80, 100), bool)
    steep[20:60, 20:80] = True
    for gap in gaps:
        steep[gap] = False
    return steep


def test_large_slopes_have_no_gaps():
    narrow, wide = np.s_[30:50, 40:48], np.s_[30:50, 55:70]
    steep = slope_with(narrow, wide)
    found = large_slopes(steep, PARAMETERS)
    assert found[narrow].all()
    assert not found[32:48, 57:68].any()
    assert found[steep].all()
    # It grows no further.
    assert not found[~slope_with()].any()


def test_specks_are_no_large_slopes_and_not_joined():
    specks = np.zeros((80, 100), bool)
    specks[20:24, 20:24] = specks[20:24, 28:32] = True
    assert not large_slopes(specks, PARAMETERS).any()
    fine = replace(PARAMETERS, min_large_slope_share=0.001)
    assert large_slopes(specks, fine)[21:23, 20:32].all()
    assert not large_slopes(np.zeros_like(specks), PARAMETERS).any()


def rough(heights_m, *, noise_m=0.001, rocks=None, **parameters):
    """Rough pixels of level ground seen from above, 1 cm apart on cells of 4 cm."""
    height_m = np.asarray(heights_m, np.float32)
    across, along = np.meshgrid(np.arange(height_m.shape[1]), np.arange(height_m.shape[0]))
    positions = map_positions(
        across.astype(np.float32) * 0.01,
        along.astype(np.float32) * 0.01,
        np.ones(height_m.shape, bool),
        0.04,
    )
    level = np.zeros(positions.shape, np.float32)
    layer = Layer(
        rows=slice(0, len(height_m)),
        positions=positions,
        pixels=np.ones(height_m.shape, bool),
        seen=np.ones(positions.shape, bool),
        is_bare=np.ones(positions.shape, bool),
        mean_m=level,
        noise_m=level,
        relief_m=level,
        information=level + 1,
        ground_m=level,
        camera_m=level + 1,
    )
    rocks = np.zeros(height_m.shape, bool) if rocks is None else rocks
    terrain = terrain_of(height_m, noise_m, (layer,))
    return rough_ground(terrain, rocks, replace(PARAMETERS, **parameters))


def test_ground_full_of_stones_is_rough_but_not_around_a_single_one():
    stones = np.zeros((200, 200))
    stones[:, 100:] = np.where(np.indices((200, 100)).sum(0) % 2, 0.09, -0.03)
    found = rough(stones, max_roughness_m=0.05)
    assert found[:, 150:].all()
    assert not found[:, :50].any()
    one = np.zeros((200, 200))
    one[100:104, 100:104] = 5.0
    assert not rough(one, max_roughness_m=0.05).any()


def test_roughness_counts_above_the_limit_and_without_noise_and_obstacles():
    stones = np.where(np.indices((200, 200)).sum(0) % 2, 0.07, -0.05)
    assert rough(stones, max_roughness_m=0.05).all()
    assert not rough(stones).any()
    assert not rough(stones, max_roughness_m=0.08).any()
    assert not rough(stones, max_roughness_m=0.05, noise_m=0.06).any()
    assert not rough(stones, max_roughness_m=0.05, rocks=np.ones((200, 200), bool)).any()


@pytest.mark.parametrize(('noise_m', 'is_rough'), [(0.015, True), (0.024, False)])
def test_noise_makes_no_ground_rough(noise_m, is_rough):
    # With less noise, 0.0518 m are the ground's own; with more, 0.0484 m.
    stones = np.where(np.indices((200, 200)).sum(0) % 2, 0.054, -0.054)
    found = rough(stones, max_roughness_m=0.05, noise_m=noise_m)
    assert found.all() if is_rough else not found.any()


def test_a_single_pixel_of_a_cell_tells_how_rough_it_is():
    rocks = np.ones((200, 200), bool)
    rocks[::4, ::4] = False
    found = rough(np.full((200, 200), 0.07), max_roughness_m=0.05, rocks=rocks)
    np.testing.assert_array_equal(found, ~rocks)


def patches_of(heights_m, noises_m=0.0):
    """Upright patches, 0.5 m high in the image and apart from each other, on level ground."""
    height_m = np.zeros((60, 20 * len(heights_m)), np.float32)
    noise_m = np.zeros_like(height_m)
    for number, each in enumerate(np.broadcast_arrays(heights_m, noises_m)[0]):
        height_m[5:55, 20 * number : 20 * number + 15] = each
    for number, each in enumerate(np.broadcast_arrays(noises_m, heights_m)[0]):
        noise_m[:, 20 * number : 20 * number + 20] = each
    return terrain_of(height_m, noise_m)


def are_tall(heights_m, noises_m=0.0, **parameters):
    """Whether each patch is tall: all of it or nothing."""
    terrain = patches_of(heights_m, noises_m)
    found = tall(terrain, replace(PARAMETERS, **parameters))
    assert not found[terrain.height_m == 0].any()
    inside = [found[5:55, 20 * n : 20 * n + 15] for n in range(len(heights_m))]
    assert all(each.all() == each.any() for each in inside)
    return [bool(each.any()) for each in inside]


def test_tall_is_what_exceeds_rocks_and_noise():
    heights_m = [0.45, 0.55, 0.8, 0.8, -3.0, np.nan]
    noises_m = [0.001, 0.001, 0.09, 0.11, 0.001, 0.001]
    assert are_tall(heights_m, noises_m) == [False, True, True, False, False, False]
    assert are_tall([0.45, 0.55], 0.001, min_wall_m=0.4) == [True, True]


def test_what_is_small_and_high_up_is_not_tall():
    # A false match: nothing that low stands 2 m high. The parts of a wall are larger.
    height_m = np.zeros((60, 60), np.float32)
    height_m[10:30, 5:20], height_m[10:36, 30:45] = 2.0, 2.0
    found = tall(terrain_of(height_m, 0.001), PARAMETERS)
    assert not found[:, :25].any()
    np.testing.assert_array_equal(found[:, 25:], height_m[:, 25:] > 0)
