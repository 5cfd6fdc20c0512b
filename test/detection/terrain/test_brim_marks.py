"""What brims mark in the image: their edges, the ground near them, and what lies behind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS, surface_of

from rover_obstacle_detection.detection.terrain.brims import Brims
from rover_obstacle_detection.detection.terrain.level_brims import AllBrims


def brims_at(surface, *places, level_m=0.0, edge_m=0.14, deep=True, sure=True):
    """Brims with given rows, columns and numbers of rows in their edges."""
    rows, columns, edge_rows = np.array(places).T
    are_deep, are_sure = (np.full(len(rows), each) for each in (deep, sure))
    levels_m, edges_m = (np.full(len(rows), each, np.float32) for each in (level_m, edge_m))
    return Brims(rows, columns, rows, are_deep, are_sure, levels_m, edges_m, edge_rows, surface)


@pytest.mark.parametrize(
    ('rows', 'columns', 'is_kept'),
    [
        (slice(16, 25), slice(18, 22), False),
        # The blur of matching.
        (slice(19, 25), slice(18, 22), False),
        (slice(20, 25), slice(18, 22), True),
        (slice(16, 25), slice(24, 30), False),
        (slice(16, 25), slice(25, 30), True),
        # A rock that is seen behind the brim, right above it.
        (slice(5, 15), slice(18, 22), True),
    ],
)
def test_a_brim_is_a_rim_of_what_lies_below_it_in_the_image(rows, columns, is_kept):
    brims = brims_at(surface_of(np.zeros((30, 40))), (15, 20, 2))
    obstacles = np.zeros((30, 40), bool)
    obstacles[rows, columns] = True
    assert brims.not_on(obstacles, PARAMETERS.brims).columns.size == is_kept


def test_an_edge_begins_in_the_blurred_rows_and_ends_with_its_ground():
    surface = surface_of(np.zeros((20, 5)))
    brims = brims_at(surface, (0, 0, 3), (5, 1, 3), (7, 1, 4), (18, 2, 6), (5, 3, 0))
    expected = np.zeros((20, 5), bool)
    expected[:4, 0] = expected[4:12, 1] = expected[17:, 2] = expected[4:6, 3] = True
    np.testing.assert_array_equal(brims.edge(PARAMETERS.brims), expected)
    unsure = replace(brims, sure=np.array([False, True, True, False, False]))
    expected[:, [0, 2, 3]] = False
    np.testing.assert_array_equal(unsure.edge(PARAMETERS.brims), expected)


def test_what_lies_a_step_lower_above_a_brim_is_beyond_it():
    height_m = np.full((12, 3), -0.11)
    height_m[:, 1] = -0.09
    height_m[4, 0] = np.nan
    surface = surface_of(height_m)
    # The other brims in the middle are those of a floor 5 cm higher.
    found = np.zeros(height_m.shape, bool)
    for brims in (
        brims_at(surface, (8, 0, 2), (3, 1, 2)),
        brims_at(surface, (5, 1, 2), level_m=0.05),
    ):
        found |= brims.beyond()
    expected = np.zeros(height_m.shape, bool)
    expected[:9, 0] = expected[:6, 1] = True
    expected[4, 0] = False
    np.testing.assert_array_equal(found, expected)


def test_the_nearest_brim_below_a_pixel_is_that_which_hides_it():
    surface = surface_of(np.full((12, 1), -0.15))
    two = brims_at(surface, (9, 0, 2), (4, 0, 2))
    lower = replace(two, level_m=np.array([0.0, -0.15], np.float32))
    assert np.flatnonzero(lower.beyond()).tolist() == [5, 6, 7, 8, 9]
    assert np.flatnonzero(two.beyond()).tolist() == list(range(10))


def test_noise_of_the_height_adds_to_the_step_below_a_brim():
    surface = surface_of([[0.0, -1.2, 1.2, 5.0]], noise_px=0.3)
    # 1 % of the distance, three deviations: of 1.2 m, 2.4 m and nothing below the camera.
    np.testing.assert_allclose(
        surface.limit_m(np.s_[:]), [[0.1 + 0.036, 0.1 + 0.072, 0.1, 0.1]], rtol=1e-5
    )


def beside(brims):
    """Ground near brims, in columns without any."""
    near = brims.near(PARAMETERS.brims)
    near[:, brims.columns] = False
    return near


def test_the_ground_beside_a_brim_along_the_view_is_marked():
    # 0.15 m of baseline and 30 px of disparity: 0.14 m are 28 columns, and rows are little ground.
    surface = surface_of(np.zeros((100, 200)))
    steep = [(20 + 30 * (column - 100), column, 2) for column in range(100, 103)]
    found = beside(brims_at(surface, *steep))
    columns = np.flatnonzero(found[50])
    assert columns[0] == pytest.approx(101 - 28, abs=2)
    assert columns[-1] == pytest.approx(101 + 28, abs=2)
    # Across the view, the edge before the brim is enough.
    across = [(50, column, 2) for column in range(60, 140)]
    assert not beside(brims_at(surface, *across)).any()
    # Brims far apart are not one.
    apart = [(20, 100, 2), (80, 110, 2)]
    assert not beside(brims_at(surface, *apart)).any()


def test_beside_a_brim_the_longer_edge_of_both_columns_counts():
    surface = surface_of(np.zeros((100, 200)))
    steep = [(20 + 30 * step, 100 + step, 2) for step in range(3)]
    brims = brims_at(surface, *steep)
    uneven = replace(brims, edge_m=np.array([0.07, 0.07, 0.14], np.float32))
    np.testing.assert_array_equal(beside(uneven)[65], beside(brims)[65])
    assert np.count_nonzero(beside(uneven)[25]) < np.count_nonzero(beside(brims)[25])
    chosen = uneven.among(np.array([False, True, True]))
    np.testing.assert_array_equal(chosen.edge_m, uneven.edge_m[1:])


def test_brims_are_joined_to_the_nearest_of_the_next_column():
    surface = surface_of(np.zeros((100, 200)))
    # Four brims that run along the view side by side, and as many columns apart as may be.
    steep = [
        (10 + 10 * step + start, 100 + 2 * step, 2)
        for start in (0, 5, 40, 45)
        for step in range(3)
    ]
    brims = brims_at(surface, *steep)
    assert beside(brims)[15:75, 101].all()


def test_all_planes_show_ground_beside_brims():
    surface = surface_of(np.zeros((100, 200)))
    steep = [(20 + 30 * step, 100 + step, 2) for step in range(3)]
    none = brims_at(surface, (5, 5, 2))
    some = brims_at(surface, *steep)
    assert not none.near(PARAMETERS.brims)[50, 120]
    for parts in ((none, some), (some, none)):
        assert AllBrims(parts).near(PARAMETERS.brims)[50, 120]


@pytest.mark.parametrize(('deep', 'sure'), [(True, True), (True, False), (False, False)])
def test_what_brims_mark_depends_on_how_sure_they_are(deep, sure):
    surface = surface_of(np.full((60, 20), -0.15))
    brims = brims_at(surface, *((30, column, 5) for column in range(20)), deep=deep, sure=sure)
    assert np.flatnonzero(brims.edge(PARAMETERS.brims)[:, 10]).size == (7 if sure else 0)
    assert np.flatnonzero(brims.near(PARAMETERS.brims)[:, 10]).tolist() == list(range(29, 41))
    assert brims.beyond()[:31].all() == brims.beyond().any() == deep


@pytest.mark.parametrize(('first', 'is_sure'), [(0, False), (9, False), (11, True)])
def test_brims_before_mostly_sparse_ground_are_not_sure(first, is_sure):
    p = PARAMETERS.brims
    surface = surface_of(np.zeros((60, 40)))
    # Two brims apart in the image. The ground before a part of the left one is sparse.
    columns = [*range(20), *range(22, 40)]
    brims = brims_at(surface, *((30, column, 3) for column in columns))
    sparse = np.zeros((60, 40), bool)
    sparse[30 + p.support_px, first:20] = True
    doubted = brims.doubted(sparse, p)
    assert doubted.sure[:20].all() == doubted.sure[:20].any() == is_sure
    assert doubted.sure[20:].all()
    assert doubted.deep.all()
    assert AllBrims((doubted, brims)).doubted(sparse, p).parts[1].sure[0] == is_sure


def test_at_the_end_of_the_image_the_last_row_tells_whether_ground_is_sparse():
    sparse = np.zeros((20, 5), bool)
    sparse[-1] = True
    brims = brims_at(surface_of(np.zeros((20, 5))), *((18, column, 2) for column in range(5)))
    assert not brims.doubted(sparse, PARAMETERS.brims).sure.any()
    none = brims.among(~brims.sure)
    assert not none.doubted(sparse, PARAMETERS.brims).sure.size
