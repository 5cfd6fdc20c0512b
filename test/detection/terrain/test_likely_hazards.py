from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, bank, block, flat, terrain_of, tilted
from synthetic import pinhole

from rover_obstacle_detection.detection.terrain.cell_evidence import cell_evidence
from rover_obstacle_detection.detection.terrain.hazard_model import HazardProbability
from rover_obstacle_detection.detection.terrain.likely_hazards import (
    asked_cells,
    judged_ground,
    likely_hazards,
    share_of_cells,
)
from rover_obstacle_detection.detection.terrain.slope import Hazard

POSED = PosedCamera(pitch_deg=40.0, height_m=1.5)


def judged(height, noise_px=0.02, edges=None, posed=POSED, **parameters):
    """Probability of slope and of drop, and x and y of each pixel; NaN where none is measured."""
    parameters = replace(PARAMETERS, **parameters)
    ground = posed.level_ground
    terrain, _, x, y = posed.survey(height, noise_px, ground, parameters)
    cells = cell_evidence(terrain, ground, parameters)
    edges = np.zeros(x.shape, bool) if edges is None else edges
    found = likely_hazards(terrain, cells, edges, ground, parameters)
    for probability in found:
        assert probability.shape == x.shape
        assert ((probability >= 0) & (probability <= 1)).all()
        assert not probability[~terrain.measured].any()
    return *found, *(np.where(terrain.measured, place, np.nan) for place in (x, y))


def hazards(*args, **options):
    slope, drop, x, y = judged(*args, **options)
    return slope + drop > 0.5, x, y


def test_flat_ground_is_no_hazard():
    found, _, y = hazards(flat)
    assert not found[y < 5].any()


@pytest.mark.parametrize(('angle', 'share'), [(28, 1), (12, 0)])
@pytest.mark.parametrize('sign', [1, -1], ids=['up', 'down'])
def test_a_slope_ahead_is_a_hazard_beyond_the_limit(angle, share, sign):
    found, _, y = hazards(bank(sign * angle, 2.0))
    assert found[(y > 2.4) & (y < 4)].mean() == pytest.approx(share, abs=0.1)
    assert not found[(y > 0.4) & (y < 1.5)].any()


@pytest.mark.parametrize(('angle', 'share'), [(28, 1), (10, 0)])
def test_a_slope_to_the_side_is_a_hazard_beyond_the_limit(angle, share):
    found, x, y = hazards(tilted(rise_x=np.tan(np.radians(angle))))
    assert found[(y < 3) & (np.abs(x) < 0.6)].mean() == pytest.approx(share, abs=0.1)


@pytest.mark.parametrize(('limit', 'share'), [(15.0, 1), (30.0, 0)])
def test_the_limit_is_a_parameter(limit, share):
    found, _, y = hazards(bank(22, 2.0), max_slope_deg=limit)
    assert found[(y > 2.4) & (y < 4)].mean() == pytest.approx(share, abs=0.15)


def test_a_ledge_is_a_hazard_on_both_sides_of_its_face():
    found, x, y = hazards(lambda x, y: 0.25 * (y > 2))
    near = np.abs(x) < 0.8
    assert found[near & (np.abs(y - 2) < 0.08)].mean() > 0.9
    assert not found[near & ((y < 1.5) | (np.abs(y - 3) < 0.4))].any()


def test_the_far_wall_of_a_trench_is_a_hazard():
    # Its near wall and floor are hidden.
    posed = PosedCamera(pinhole(400, 300, 60.0, 0.15), 30.0, 1.2)
    found, x, y = hazards(lambda x, y: -0.5 * ((y > 2.0) & (y < 2.5)), posed=posed)
    wall = (np.abs(x) < 0.8) & (y > 2.3) & (y < 2.52)
    assert wall.sum() > 100
    assert found[wall].mean() > 0.8
    assert found[(np.abs(y - 3.5) < 0.3)].mean() < 0.05


@pytest.mark.parametrize(('depth', 'share'), [(0.3, 1), (0.04, 0)])
def test_a_pit_is_a_hazard_if_it_is_deeper_than_a_step(depth, share):
    found, x, y = hazards(block(0.0, 2.0, 0.8, -depth))
    inner = np.maximum(abs(x), abs(y - 2)) < 0.3
    assert inner.sum() > 100
    assert found[inner].mean() == pytest.approx(share, abs=0.15)


def test_slopes_and_the_floors_of_pits_are_told_apart():
    slope, drop, _, y = judged(bank(28, 2.0))
    on_slope = (y > 2.4) & (y < 4)
    assert (slope > drop)[on_slope].mean() > 0.95
    slope, drop, x, y = judged(block(0.0, 2.0, 1.2, -0.25))
    floor = np.maximum(abs(x), abs(y - 2)) < 0.2
    assert (drop > slope)[floor].mean() > 0.8


def rows_of(*values):
    """An image in which each row has one value."""
    return np.repeat(np.float32(values)[:, np.newaxis], 2, axis=1)


def test_network_and_limits_judge_together():
    # Nothing; slope; drop; slope where few matches are supported; measured, and ruled out by the
    # network; measured, and not ruled out; possible by the network; too noisy.
    slope = rows_of(0.0, 0.8, 0.1, 0.8, 0.05, 0.2, 0.15, 0.9)
    drop = rows_of(0.0, 0.1, 0.7, 0.1, 0.0, 0.1, 0.0, 0.0)
    sparse = rows_of(0, 0, 0, 1, 0, 0, 0, 0) > 0
    measured = rows_of(0, 0, 0, 0, 1, 1, 0, 0) > 0
    noise_m = rows_of(*7 * (0.01,), 10.0)
    nothing = np.zeros_like(sparse)
    terrain = terrain_of(np.zeros(sparse.shape, np.float32), noise_m)
    slopes, drops = judged_ground(
        HazardProbability(slope, drop),
        Hazard(measured, measured),
        Hazard(nothing, nothing),
        sparse,
        terrain,
        PARAMETERS,
    )
    np.testing.assert_array_equal(slopes.found[:, 0], [0, 1, 0, 0, 0, 1, 0, 0])
    np.testing.assert_array_equal(drops.found[:, 0], [0, 0, 1, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(slopes.possible[:, 0], [0, 1, 1, 1, 1, 1, 1, 1])
    # For limits that it was not trained for, the network only makes less ground free.
    for strange in ({'max_step_m': 0.05}, {'max_slope_deg': 5.0}, {'max_slope_deg': 45.0}):
        slopes, drops = judged_ground(
            HazardProbability(slope, drop),
            Hazard(measured, measured),
            Hazard(nothing, nothing),
            sparse,
            terrain,
            replace(PARAMETERS, **strange),
        )
        np.testing.assert_array_equal(slopes.found, measured)
        assert not drops.found.any()
        np.testing.assert_array_equal(slopes.possible[:, 0], [0, 1, 1, 1, 1, 1, 1, 1])
    slopes, drops = judged_ground(
        HazardProbability(slope, drop),
        Hazard(nothing, nothing),
        Hazard(measured, measured),
        sparse,
        terrain,
        PARAMETERS,
    )
    np.testing.assert_array_equal(drops.found[:, 0], [0, 0, 1, 0, 0, 1, 0, 0])
    np.testing.assert_array_equal(drops.possible, measured)


def test_what_the_network_cannot_judge_is_possible():
    terrain = terrain_of(np.zeros((1, 2), np.float32), 0.01)
    unknown = HazardProbability(np.float32([[np.nan, 0]]), np.float32([[0, 0]]))
    measured = Hazard(np.array([[True, False]]), np.array([[True, False]]))
    nothing = Hazard(*np.zeros((2, 1, 2), bool))
    slopes, _ = judged_ground(unknown, measured, nothing, nothing.found, terrain, PARAMETERS)
    np.testing.assert_array_equal(slopes.found, [[True, False]])
    np.testing.assert_array_equal(slopes.possible, [[True, False]])
    without = judged_ground(None, measured, nothing, nothing.found, terrain, PARAMETERS)
    assert without == (measured, nothing)


def test_cells_that_no_pixel_of_the_span_shows_are_not_asked_about():
    terrain, *_ = POSED.survey(flat)
    near, far = terrain.layers[:2]
    for layer in (near, far):
        asked = asked_cells(layer)
        rows, columns = (
            np.rint(each[layer.pixels]).astype(int)
            for each in (layer.positions.row, layer.positions.column)
        )
        assert asked[rows, columns].all()
        assert asked.sum() < 1.3 * layer.seen.sum()
    # The farther map overlaps the nearer one.
    assert far.seen[0].any()
    assert not asked_cells(far)[0].any()


def test_share_of_cells_is_that_of_their_pixels():
    terrain, _, x, y = POSED.survey(flat)
    layer = terrain.layers[0]
    share = share_of_cells(y > 2, layer)
    along_m = (np.arange(len(share)) + layer.positions.first_row) * layer.positions.cell_m
    seen = layer.seen.any(axis=1)
    assert share[seen & (along_m < 1.9)].max() == 0
    inner = layer.seen & ((along_m > 2.1) & (along_m < 3))[:, np.newaxis]
    np.testing.assert_allclose(share[inner], 1)
    assert not share_of_cells(np.zeros(x.shape, bool), layer).any()
