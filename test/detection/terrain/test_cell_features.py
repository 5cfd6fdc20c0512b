from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, bank, block, flat, tilted

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain import cell_features as module
from rover_obstacle_detection.detection.terrain.cell_evidence import cell_evidence
from rover_obstacle_detection.detection.terrain.cell_features import (
    FEATURES,
    FEATURES_VERSION,
    cell_features,
)

POSED = PosedCamera(pitch_deg=40.0, height_m=1.5)


def features_of(height, ground=POSED.level_ground, brim=0.0, noise_px=0.02, **parameters):
    """Features of the nearest map by name, and what it was measured of."""
    parameters = replace(PARAMETERS, **parameters)
    terrain, *_ = POSED.survey(height, noise_px, ground, parameters)
    cells = cell_evidence(terrain, ground, parameters)[0]
    share = np.full(cells.layer.seen.shape, brim, np.float32)
    made = cell_features(cells.layer, cells.rise, cells.hollows, share, ground, parameters)
    assert made.dtype == np.float32
    return dict(zip(FEATURES, made, strict=True)), cells.layer


def places(layer):
    """Metres to the right and forward of each cell."""
    rows, columns = np.indices(layer.seen.shape)
    cell_m, at = layer.positions.cell_m, layer.positions
    return (columns + at.first_column) * cell_m, (rows + at.first_row) * cell_m


def test_names_are_unique_and_the_definition_has_a_version():
    assert len(set(FEATURES)) == len(FEATURES)
    assert FEATURES_VERSION


@pytest.mark.parametrize('limit_deg', [10.0, 20.0, 30.0])
def test_slopes_are_relative_to_the_limit(limit_deg):
    found, layer = features_of(tilted(rise_x=0.2, rise_y=-0.1), max_slope_deg=limit_deg)
    limit = math.tan(math.radians(limit_deg))
    inner = layer.seen & (np.abs(places(layer)[0]) < 0.4)
    for name, rise in (
        ('rise to the right over the slope', 0.2),
        ('rise ahead over the slope', -0.1),
        ('steepness over the slope', math.hypot(0.2, 0.1)),
    ):
        assert np.median(found[name][inner]) == pytest.approx(rise / limit, rel=0.1), name


def test_differences_are_those_of_neighbouring_cells_along_the_vertical():
    found, layer = features_of(tilted(rise_x=0.2, rise_y=-0.1))
    limit = math.tan(math.radians(20))
    for name, rise in (
        ('difference to the left over the slope', 0.2),
        ('difference to the near side over the slope', -0.1),
    ):
        among = found[name][layer.seen & (places(layer)[1] < 2)]
        assert among.mean() == pytest.approx(rise / limit, rel=0.15), name


def test_a_difference_needs_both_cells():
    level = np.array([[1, 2, 5, 9], [3, 3, 3, 3]], np.float32)
    seen = np.array([[1, 1, 0, 1], [1, 0, 1, 1]], bool)
    across = module._difference(level, seen, axis=1)
    np.testing.assert_array_equal(across, [[0, 1, 0, 0], [0, 0, 0, 0]])
    along = module._difference(level, seen, axis=0)
    np.testing.assert_array_equal(along, [[0, 0, 0, 0], [2, 0, 0, -6]])


def test_slopes_are_measured_against_the_vertical():
    ground = GroundPlane(POSED.up, POSED.height_m, Gravity.from_angles(POSED.pitch_deg - 12).up)
    found, layer = features_of(flat, ground)
    inner = layer.seen & (np.abs(places(layer)[0]) < 0.4)
    ratio = math.tan(math.radians(12)) / math.tan(math.radians(20))
    for name in ('steepness over the slope', 'rise ahead over the slope'):
        assert np.median(found[name][inner]) == pytest.approx(ratio, rel=0.1), name


@pytest.mark.parametrize('step_m', [0.1, 0.2])
def test_heights_and_depths_are_relative_to_the_step(step_m):
    found, layer = features_of(block(0, 2, 0.3, 0.2), max_step_m=step_m)
    x, y = places(layer)
    top = layer.seen & (np.abs(x) < 0.1) & (np.abs(y - 2) < 0.1)
    height = np.median(found['height over the local ground over the step'][top])
    assert height == pytest.approx(0.2 / step_m, rel=0.2)
    found, layer = features_of(block(0, 2, 0.8, -0.3), max_step_m=step_m)
    x, y = places(layer)
    pit = layer.seen & (np.abs(x) < 0.2) & (np.abs(y - 2) < 0.2)
    depth = np.median(found['depth below the rim over the step'][pit])
    assert depth == pytest.approx(0.3 / step_m, rel=0.2)


def test_relief_is_that_of_a_face_within_its_cells():
    found, layer = features_of(lambda x, y: 0.4 * (y > 2))
    _, y = places(layer)
    relief = found['relief within the cell over the step']
    face = layer.seen & (np.abs(y - 2) < 0.03)
    assert relief[face].max() == pytest.approx(0.4 / math.sqrt(12) / 0.1, rel=0.3)
    assert relief[layer.seen & (y < 1.7)].max() < 0.1


def test_what_is_the_same_everywhere():
    found, layer = features_of(flat, brim=0.25, max_step_m=0.2)
    np.testing.assert_array_equal(found['brim'], 0.25)
    np.testing.assert_allclose(found['step'], math.log(2))
    np.testing.assert_allclose(
        found['side of a cell'], math.log(layer.positions.cell_m / 0.04) / 2, atol=1e-6
    )
    _, y = places(layer)
    np.testing.assert_allclose(found['distance'], np.log(np.maximum(y, 0.3)), rtol=1e-5)
    np.testing.assert_array_equal(found['seen'], layer.seen)
    np.testing.assert_array_equal(found['bare'], layer.is_bare)


@pytest.mark.parametrize('slope_deg', [0.0, 0.01, 45.0])
def test_features_are_finite_and_bounded_whatever_the_limits(slope_deg):
    found, _ = features_of(bank(60, 2.0), noise_px=5.0, max_step_m=0.005, max_slope_deg=slope_deg)
    for name, feature in found.items():
        assert np.isfinite(feature).all(), name
        assert np.abs(feature).max() <= 6, name
