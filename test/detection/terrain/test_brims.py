"""Ground that ends at a drop whose face cannot be seen."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, bank, block, flat
from synthetic import pinhole

from rover_obstacle_detection.detection.terrain.brim_parameters import BrimParameters
from rover_obstacle_detection.detection.terrain.brims import find_brims, steep_length_m
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters

# As many rows as in real images: a few of them are little ground.
CAMERA = pinhole(44, 320, 60.0, 0.15)
POSED = PosedCamera(CAMERA, pitch_deg=30.0, height_m=1.2)
COLUMNS = POSED.camera.width


def edge(depth_m=0.5, distance_m=2.0, turn=0.0):
    """A lower floor beyond a line across the view, or one that recedes to the right."""
    return lambda x, y: np.where(y > distance_m + turn * x, -depth_m, 0.0)


def trench(depth_m, width_m, distance_m=1.5):
    return lambda x, y: np.where((y > distance_m) & (y < distance_m + width_m), -depth_m, 0.0)


def hole(distance_m, width_m):
    return lambda x, y: np.where((abs(x) < width_m / 2) & (abs(y - distance_m - 1) < 1), -0.4, 0.0)


class Found:
    """Deep brims of ground matched without error, and the places that the pixels show."""

    def __init__(self, height, *, posed=POSED, missing=None, noise_px=0.05, **parameters):
        disparity, self.x, self.y = looked(posed, height)
        if missing is not None:
            disparity = np.where(missing(self.x, self.y), 0, disparity).astype(np.float32)
        self.parameters = replace(PARAMETERS, **parameters)
        self.disparity = disparity
        every = find_brims(posed.stereo(disparity, noise_px), self.parameters)
        self.brims = every.among(every.deep)
        self.possible = every.among(~every.deep)
        self.beyond = every.beyond()
        self.edge = every.edge(self.parameters.brims)
        self.near = every.near(self.parameters.brims)

    @property
    def columns(self):
        return np.unique(self.brims.columns)

    @property
    def places(self):
        """Places x, y of the last pixels before the brims."""
        at = self.brims.rows, self.brims.columns
        return self.x[at], self.y[at]


@cache
def looked(posed, height):
    return posed.look(height)


def test_level_ground_has_no_brim():
    found = Found(flat)
    assert not found.columns.size
    assert not found.edge.any()
    assert not found.beyond.any()


@pytest.mark.parametrize('turn', [0.0, 0.4, -0.4])
@pytest.mark.parametrize('depth_m', [0.15, 0.5, 2.0])
def test_an_edge_is_a_brim_in_each_column(depth_m, turn):
    found = Found(edge(depth_m, turn=turn))
    assert found.columns.size > 0.97 * COLUMNS
    assert found.brims.columns.size == found.columns.size, 'one in each'
    x, y = found.places
    before_m = 2 + turn * x - y
    # Two rows of the image are up to 7 cm of ground.
    assert before_m.min() > 0
    assert np.quantile(before_m, 0.98) < 0.07
    np.testing.assert_allclose(found.brims.level_m, 0, atol=1e-3)
    assert found.brims.sure.all()


@pytest.mark.parametrize('roll_deg', [-25.0, 0.0, 25.0])
def test_distances_are_along_the_ground_of_a_camera_that_rolls(roll_deg):
    posed = replace(POSED, roll_deg=roll_deg)
    found = Found(flat, posed=posed)
    rows, columns = np.nonzero(found.disparity > 1)
    along_m = found.brims.surface.points(rows, columns).along_m
    np.testing.assert_allclose(along_m, found.y[rows, columns], rtol=1e-3, atol=1e-3)


def test_a_row_before_the_brim_is_followed_by_the_lower_floor():
    found = Found(edge())
    brims = found.brims
    assert (found.y[brims.drop_rows - 1, brims.columns] > 2).all()
    assert (brims.drop_rows <= brims.rows).all()


@pytest.mark.parametrize(('depth_m', 'max_step_m'), [(0.08, 0.1), (0.5, 0.6)])
def test_an_edge_no_higher_than_a_step_is_no_deep_brim(depth_m, max_step_m):
    assert not Found(edge(depth_m), max_step_m=max_step_m).columns.size


def test_noise_hides_a_brim():
    assert Found(edge(0.2), noise_px=0.1).columns.size > 0.9 * COLUMNS
    assert not Found(edge(0.2), noise_px=1.0).columns.size


@pytest.mark.parametrize('max_step_m', [0.1, 0.6])
def test_twice_the_edge_of_a_brim_is_never_free_also_where_it_is_only_possible(max_step_m):
    found = Found(edge(0.5), max_step_m=max_step_m)
    assert found.near[found.edge].all()
    before_m = 2 - found.y[found.near & (found.y < 2)]
    assert 0.2 < before_m.max() < 0.35
    assert found.near.any(axis=0).mean() > 0.97


def test_a_fall_of_more_than_half_a_step_may_be_a_brim():
    found = Found(edge(0.5), max_step_m=0.6)
    assert not found.columns.size
    assert not found.edge.any()
    assert not found.beyond.any()
    assert np.unique(found.possible.columns).size > 0.97 * COLUMNS
    assert not found.possible.sure.any()
    assert not Found(edge(0.5), max_step_m=1.1).possible.columns.size
    assert not Found(edge(0.5)).possible.columns.size, 'each brim once'


@pytest.mark.parametrize('depth_m', [0.15, 0.35, 0.5, 0.7])
def test_the_last_ground_before_a_brim_is_its_edge_longer_before_deeper_falls(depth_m):
    found = Found(edge(depth_m))
    before_m = np.where(found.edge, 2 - found.y, np.nan)[found.y < 2]
    assert np.nanmin(before_m) < 0.03
    expected_m = steep_length_m(np.array([depth_m], np.float32), found.parameters)[0]
    assert np.nanmax(before_m) == pytest.approx(expected_m, abs=0.03)
    np.testing.assert_allclose(np.median(found.brims.edge_m), expected_m, atol=0.01)
    marked = found.edge.sum(axis=0)[found.columns]
    p = found.parameters.brims
    assert (marked == found.brims.edge_rows + p.blur_px + 1).all()


@pytest.mark.parametrize('max_slope_deg', [15.0, 25.0])
@pytest.mark.parametrize('fall_m', [0.1, 0.2, 0.4, 2.0])
def test_an_edge_is_as_long_as_the_smoothed_fall_is_too_steep(fall_m, max_slope_deg):
    p = TerrainParameters(max_slope_deg=max_slope_deg)
    cell_m, scale_m = 0.001, p.rise_scales_m[0]
    ground = np.where(np.arange(2001) < 1000, 0, -fall_m).astype(np.float32)[np.newaxis]
    smooth = cv2.GaussianBlur(ground, (0, 0), scale_m / cell_m)[0]
    too_steep = -np.gradient(smooth, cell_m) > math.tan(math.radians(max_slope_deg))
    expected_m = np.clip(cell_m * np.count_nonzero(too_steep[:1000]), *p.brims.edge_m)
    found_m = steep_length_m(np.array([fall_m, np.nan], np.float32), p)
    np.testing.assert_allclose(found_m, [expected_m, p.brims.edge_m[0]], atol=2 * cell_m)


@pytest.mark.parametrize('limits', [{'max_slope_deg': 90.0}, {'max_step_m': 0.01}])
def test_an_edge_is_no_shorter_for_a_rover_that_climbs_any_slope_or_no_step(limits):
    p = TerrainParameters(**limits)
    found_m = steep_length_m(np.array([0.1, 10.0], np.float32), p)
    assert found_m.min() >= np.float32(p.brims.edge_m[0])
    np.testing.assert_allclose(found_m[1], 0.14 if 'max_slope_deg' in limits else 0.2)


def test_an_edge_ends_with_the_image():
    found = Found(edge(distance_m=0.75))
    assert found.columns.size > 0.9 * COLUMNS
    assert (found.brims.rows + found.brims.edge_rows > POSED.camera.height).all()
    assert found.edge[-1].mean() > 0.9


def test_an_edge_has_some_rows_however_far_away():
    p = BrimParameters(edge_px=60)
    found = Found(edge(), brims=p)
    assert (found.edge.sum(axis=0)[found.columns] == p.blur_px + 61).all()


def test_what_lies_lower_behind_a_brim_is_beyond_it():
    found = Found(edge())
    lower = (found.y > 2) & (found.disparity > 0)
    assert not found.beyond[~lower].any()
    # Matching blurs a jump, so that the next few rows above it do not count.
    missed = (lower & ~found.beyond).sum(axis=0)
    assert missed.max() < found.parameters.brims.reach_px
    assert lower.sum(axis=0).min() > 100


def test_the_ground_behind_a_trench_is_not_beyond_its_brim():
    found = Found(trench(0.4, 1.0))
    assert found.columns.size > 0.97 * COLUMNS
    far = (found.y > 2.6) & (found.disparity > 0)
    assert not found.beyond[far].any()
    floor = (found.y > 2.1) & (found.y < 2.45)
    assert floor.sum() > 500
    assert found.beyond[floor].mean() > 0.97
    assert not found.beyond[found.y < 1.5].any()


def test_the_nearest_of_two_brims_counts():
    def two(x, y):
        return np.where(y > 3.0, -0.8, np.where(y > 1.5, -0.3, 0.0))

    found = Found(two)
    rows = np.bincount(found.brims.columns, minlength=COLUMNS)
    assert (rows == 2).mean() > 0.9
    levels = np.sort(found.brims.level_m)
    np.testing.assert_allclose(levels[[5, -5]], [-0.3, 0], atol=0.01)
    middle = (found.y > 1.7) & (found.y < 2.9)
    assert found.beyond[middle].mean() > 0.93


@pytest.mark.parametrize('angle_deg', [-8, -12, -16])
def test_a_crest_is_no_brim(angle_deg):
    # Where the slope begins, the ground is seen ever more obliquely.
    found = Found(bank(angle_deg, 2.0, softness_m=0.25))
    assert found.columns.size < 0.02 * COLUMNS


def test_the_top_of_a_rock_is_no_brim():
    found = Found(block(0.0, 1.8, 0.25, 0.3))
    assert (found.disparity > 0).any()
    assert not found.columns.size


def test_the_far_rim_of_a_platform_is_a_brim_unless_it_is_on_an_obstacle():
    found = Found(lambda x, y: np.where((abs(x) < 0.12) & (abs(y - 2) < 0.2), 0.2, 0.0))
    assert 20 < found.columns.size < COLUMNS
    np.testing.assert_allclose(found.brims.level_m, 0.2, atol=0.01)
    left_part = np.zeros(found.disparity.shape, bool)
    parameters = found.parameters.brims
    # Matching blurs a rim by some pixels.
    left_part[:, : 22 - parameters.reach_px] = True
    kept = found.brims.not_on(left_part, parameters)
    expected = found.brims.columns >= 22
    assert 0 < expected.sum() < expected.size
    for name in ('rows', 'columns', 'drop_rows', 'sure', 'level_m'):
        np.testing.assert_array_equal(
            getattr(kept, name), getattr(found.brims, name)[expected], err_msg=name
        )
    assert not kept.beyond()[:, :22].any()
    assert not found.brims.not_on(np.ones_like(left_part), parameters).edge(parameters).any()


@pytest.mark.parametrize(('gap_m', 'is_found'), [(0.4, True), (1.4, False)])
def test_a_brim_may_have_a_few_rows_without_a_match_above_it(gap_m, is_found):
    # The sight line over the brim meets the lower floor 5.33 m ahead.
    found = Found(edge(2.0), missing=lambda x, y: (y > 2.0) & (y < 5.33 + gap_m))
    gap_rows = ((found.y > 2.0) & (found.y < 5.33 + gap_m)).sum(axis=0)
    p = found.parameters.brims
    assert (gap_rows < p.max_unseen_px + 2 * p.reach_px).all() == is_found
    assert (found.columns.size > 0.97 * COLUMNS) == is_found
    if is_found:
        assert found.places[1].min() > 1.93
    else:
        assert not found.columns.size


def test_what_ends_without_anything_seen_behind_it_is_no_brim():
    found = Found(edge(0.5), missing=lambda x, y: y > 2.0)
    assert not found.columns.size


@pytest.mark.parametrize(
    ('width_m', 'distance_m', 'is_found'),
    [(0.1, 1.2, False), (0.2, 1.2, True), (0.2, 2.6, False), (0.4, 2.6, True)],
)
def test_brims_narrower_than_a_wheel_or_far_away_are_dropped(width_m, distance_m, is_found):
    found = Found(hole(distance_m, width_m))
    assert (found.columns.size > 0) == is_found
    if is_found:
        x, y = found.places
        assert np.abs(x).max() < width_m / 2 + 0.03
        assert np.median(y) == pytest.approx(distance_m, abs=0.05)


def only(*columns, posed=POSED):
    """Matches are missing in all other columns."""
    seen = np.isin(np.arange(posed.camera.width), np.r_[columns])
    return lambda x, y: np.broadcast_to(~seen, x.shape)


@pytest.mark.parametrize(('gap', 'is_found'), [(4, True), (6, False)])
def test_parts_of_a_brim_with_a_few_columns_between_them_count_together(gap, is_found):
    # Each part is 11 cm wide, with its surroundings.
    found = Found(edge(distance_m=1.2), missing=only(np.s_[8:20], np.s_[20 + gap : 32 + gap]))
    assert (found.columns.size > 0) == is_found


def test_a_single_column_is_no_brim():
    coarse = replace(POSED, camera=CAMERA.resized(22, 160))
    assert Found(edge(), posed=coarse).columns.size > 20
    assert not Found(edge(), posed=coarse, missing=only(np.s_[10:11], posed=coarse)).columns.size


def test_the_last_row_of_the_image_belongs_to_the_ground_before_a_brim():
    disparity, _, y = looked(POSED, edge(distance_m=0.9))
    assert y[-1].max() > 0.6
    assert find_brims(POSED.stereo(disparity), PARAMETERS).columns.size > 0.9 * COLUMNS
    disparity = disparity.copy()
    # 0.3 m higher on the same rays.
    disparity[-1] /= 1 - 0.3 / POSED.height_m
    # The image is 0.14 m wide there.
    narrow = replace(PARAMETERS, brims=replace(PARAMETERS.brims, min_width_m=0.1))
    rows = find_brims(POSED.stereo(disparity), narrow).rows
    in_last_row = np.count_nonzero(rows == POSED.camera.height - 1)
    assert in_last_row > 0.9 * COLUMNS, 'the last row itself ends in a jump'


@pytest.mark.parametrize(
    ('height_m', 'is_found', 'is_sure'),
    [(0.2, False, False), (0.34, True, False), (0.5, True, True)],
)
def test_flat_sight_lines_leave_doubt(height_m, is_found, is_sure):
    # Seen under 6, 9.5 and 14 degrees.
    posed = PosedCamera(CAMERA, pitch_deg=12.0, height_m=height_m)
    found = Found(edge(0.5), posed=posed)
    assert (found.columns.size > 0.9 * COLUMNS) == is_found
    assert found.brims.sure.all() == is_sure or not is_found
    assert found.edge.any() == is_sure
    assert found.beyond.any() == is_found


def test_images_of_a_few_rows_have_no_brims():
    posed = replace(POSED, camera=CAMERA.resized(44, 8))
    assert not Found(edge(), posed=posed).columns.size


def test_without_any_match_there_is_no_brim():
    assert not Found(edge(), missing=lambda x, y: y > -9).columns.size


@pytest.mark.parametrize(
    ('tread_m', 'steps'), [(0.3, (0,)), (0.4, (0, 2)), (0.6, (0, 1)), (0.8, (0, 1))]
)
def test_stairs_down_have_brims(tread_m, steps):
    # Of each tread, only the last part is seen behind the step before it.
    def height(x, y):
        return -0.2 * np.clip(np.ceil((y - 2) / tread_m), 0, 3)

    found = Found(height)
    y = found.y[found.brims.rows, found.brims.columns]
    for step in steps:
        on_step = np.abs(y - 2 - step * tread_m) < 0.1
        assert np.unique(found.brims.columns[on_step]).size > 0.9 * COLUMNS
    assert y.min() > 1.9


def test_a_brim_below_rows_without_a_match_is_one():
    found = Found(edge(), missing=lambda x, y: (y > 2.0) & (y < 2.3))
    pixels = np.stack((found.brims.rows, found.brims.columns))
    assert np.unique(pixels, axis=1).shape == pixels.shape
    assert found.columns.size > 0.9 * COLUMNS


@pytest.mark.parametrize('angle_deg', [30, 35])
def test_a_slope_down_with_few_matches_has_no_brim(angle_deg):
    seen = np.random.default_rng(2).random(looked(POSED, flat)[0].shape) < 0.5
    found = Found(bank(-angle_deg, 1.2), missing=lambda x, y: ~seen)
    assert not found.brims.sure.any()
