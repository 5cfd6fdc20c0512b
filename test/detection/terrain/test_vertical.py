from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from relief import PARAMETERS, PosedCamera, bank, block, flat, tilted, together

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain import vertical as module
from rover_obstacle_detection.detection.terrain.elevation_map import MapPositions
from rover_obstacle_detection.detection.terrain.survey import survey
from rover_obstacle_detection.detection.terrain.terrain import Layer
from rover_obstacle_detection.detection.terrain.vertical import likely_verticals
from rover_obstacle_detection.detection.terrain.vertical_parameters import VerticalParameters

POSED = PosedCamera()
LEANING = GroundPlane(
    Gravity.from_angles(POSED.pitch_deg - 4, 2.0).up,
    1.3,
    Gravity.from_angles(POSED.pitch_deg + 9, -5.0).up,
)


def apart_deg(one, other):
    return math.degrees(math.acos(min(1.0, float(np.dot(one, other)))))


def vertical_of(layers, ground=POSED.level_ground):
    found, *_ = likely_verticals(layers, ground, PARAMETERS)
    assert np.linalg.norm(found) == pytest.approx(1)
    return found


def vertical(height, posed=POSED, ground=None):
    terrain, *_ = posed.survey(height, ground=ground)
    return vertical_of(terrain.layers, ground or posed.level_ground)


def normal_of(rise_x, rise_y):
    normal = np.array([-rise_x, -rise_y, 1]) @ POSED.axes
    return normal / np.linalg.norm(normal)


@pytest.mark.parametrize('pose', [{}, {'pitch_deg': 10}, {'pitch_deg': 60}, {'roll_deg': 12}])
def test_vertical_is_the_normal_of_flat_ground(pose):
    posed = PosedCamera(**pose)
    assert apart_deg(vertical(flat, posed), posed.up) < 0.1


def test_vertical_does_not_depend_on_the_ground_plane():
    assert apart_deg(vertical(flat, ground=LEANING), POSED.up) < 0.1
    assert apart_deg(LEANING.normal, POSED.up) > 4


@pytest.mark.parametrize(('rise_x', 'rise_y'), [(0.15, 0.0), (0.0, 0.15), (-0.1, -0.12)])
def test_vertical_is_the_normal_of_a_slope_that_fills_the_view(rise_x, rise_y):
    assert apart_deg(vertical(tilted(rise_x, rise_y)), normal_of(rise_x, rise_y)) < 0.2


@pytest.mark.parametrize(('rise', 'is_kept'), [(0.25, False), (0.3, True)])
def test_the_plane_keeps_its_vertical_if_the_ground_turns_too_far_from_it(rise, is_kept):
    # 14 and 17 degrees.
    expected = POSED.up if is_kept else normal_of(0.0, rise)
    assert apart_deg(vertical(tilted(0.0, rise)), expected) < 0.2


@pytest.mark.parametrize('softness', [0.0, 0.2], ids=['sharp', 'soft'])
@pytest.mark.parametrize('start', [2.5, 3.2])
@pytest.mark.parametrize('angle', [26, -26, 12])
def test_slope_ahead_does_not_count(angle, start, softness):
    # A lower camera would not see a slope that falls away.
    high = PosedCamera(height_m=2.0)
    assert apart_deg(vertical(bank(angle, start, softness), high), high.up) < 2


def terraces(*edges, step_m, turn=0.0):
    """Level ground that steps up beyond each line across the view."""
    return lambda x, y: sum((y > edge + turn * x) * step_m for edge in edges)


@pytest.mark.parametrize(
    ('edges', 'step_m', 'turn'),
    [
        ((2.5,), 0.15, 0.0),
        ((2.5,), 0.4, 0.3),
        ((2.0,), -0.2, 0.0),
        ((2.0, 3.0, 4.0), 0.15, 0.0),
        ((2.0, 2.7), 0.2, 0.0),
    ],
)
def test_ledges_and_terraces_do_not_tilt_the_vertical(edges, step_m, turn):
    high = PosedCamera(height_m=2.0)
    assert apart_deg(vertical(terraces(*edges, step_m=step_m, turn=turn), high), high.up) < 0.5


def test_steps_that_fit_only_a_little_better_come_second():
    high = PosedCamera(height_m=2.0)
    terrain, *_ = high.survey(terraces(2.5, 3.2, step_m=-0.2))
    never_much_better = replace(PARAMETERS.vertical, max_cost_share=0.0)
    parameters = replace(PARAMETERS, vertical=never_much_better)
    plane, steps = likely_verticals(terrain.layers, high.level_ground, parameters)
    assert apart_deg(plane, high.up) > 2
    assert apart_deg(steps, high.up) < 0.5
    assert likely_verticals(terrain.layers, high.level_ground, PARAMETERS) == [steps]


def test_a_ledge_on_a_slope_does_not_tilt_the_vertical():
    height = together(tilted(0.1, 0.05), terraces(2.5, step_m=0.3))
    assert apart_deg(vertical(height), normal_of(0.1, 0.05)) < 0.5


@pytest.mark.parametrize(('pitch_deg', 'height_m'), [(45, 1.2), (46, 0.9)])
def test_slope_that_begins_gently_hardly_counts(pitch_deg, height_m):
    # A later bend of a smaller angle fits about as well as the true one.
    def relief(x, y):
        return 0.012 * np.sin(2 * np.pi * x / 1.1 + 1) * np.cos(2 * np.pi * y / 0.9 + 1)

    slope = bank(-26, 1.4, 0.4)
    posed = PosedCamera(pitch_deg=pitch_deg, height_m=height_m)
    assert apart_deg(vertical(together(slope, relief), posed), posed.up) < 2.3


def cells_of(height, side_m=0.1):
    """Cells of the same weight on a patch of ground before the rover."""
    across, forward = np.meshgrid(np.arange(-1, 1, side_m), np.arange(0.3, 4, side_m))
    x, y = across.ravel(), forward.ravel()
    return np.column_stack((x, y, height(x, y), np.full(x.size, 1 / x.size)))


def test_the_rise_before_a_soft_bend_is_that_under_the_rover():
    soft = together(tilted(0.0, 0.05), bank(20, 1.0, 0.5))
    found = module._mean_bend(cells_of(soft), VerticalParameters())
    rise = math.tan(math.radians(20))
    # The bend begins behind the rover.
    assert found.rise_before == pytest.approx(0.05 + rise / (1 + math.exp(1.0 / 0.5)), abs=0.02)
    assert found.rise_beyond == pytest.approx(0.05 + rise, abs=0.01)
    assert found.distance_m == pytest.approx(1.0, abs=0.1)


def test_a_fit_has_the_least_cost():
    height = together(tilted(0.1, 0.05), block(0.3, 2.0, 0.8, 0.05), block(-0.4, 3.0, 0.6, -0.3))
    cells, p = cells_of(height), VerticalParameters(iterations=200)

    def cost(solution):
        off = cells[:, 2] - solution @ np.vstack((np.ones(len(cells)), cells[:, :2].T))
        return (cells[:, 3] * np.log1p((off / p.relief_m) ** 2)).sum()

    plane, found = module._fit(cells, p)
    assert found == pytest.approx(cost(plane), rel=1e-6)
    for change in 3e-4 * np.vstack((np.eye(3), -np.eye(3))):
        assert cost(plane + change) > found


def test_a_bend_of_the_true_shape_fits_without_error():
    soft = together(tilted(0.1, 0.05), bank(20, 1.0, 0.5), lambda x, y: 0.7)
    hinges_m, widths_m = np.array([1.0, 2.0]), np.array([0.5, 0.15])
    bends, costs = module._fit_bends(
        cells_of(soft), np.zeros(2), hinges_m, widths_m, VerticalParameters()
    )
    expected = [math.tan(math.radians(20)), 0.7, 0.1, 0.05]
    np.testing.assert_allclose(bends[0], expected, atol=1e-3)
    assert costs[0] < 1e-5 < costs[1]


@pytest.mark.parametrize('turn_deg', [0.0, 20.0])
@pytest.mark.parametrize('missing', [0, 1])
def test_the_nearer_half_before_a_bend_counts_as_much_as_all_of_it(turn_deg, missing):
    turn = math.radians(turn_deg)
    ahead = np.array([math.sin(turn), math.cos(turn)])

    def height(x, y):
        along = x * ahead[0] + y * ahead[1]
        return 5 + 0.02 * along + 0.08 * np.maximum(along - 1.2, 0)

    cells = cells_of(height)
    along = cells[:, :2] @ ahead
    first = np.quantile(along, 0.02)
    nearer = np.count_nonzero(along < first + 0.5 * (2.0 - first))
    bend = module._Bend(turn, 2.0, 0.0, 0.1, 0.6, 0.0)
    p = VerticalParameters(min_cells=nearer + missing)
    # The nearer half rises by 0.02. If it has too few cells, the bend's own rise counts.
    rise = 0.1 if missing else 0.06
    np.testing.assert_allclose(module._rises_before(bend, cells, p), rise * ahead, atol=1e-4)


@pytest.mark.parametrize('edges', [(2.05,), (1.15, 2.05)])
def test_as_many_steps_are_found_as_may_be(edges):
    height = together(tilted(0.1, 0.05), terraces(1.15, step_m=0.2), terraces(2.05, step_m=0.4))
    found = module._find_steps(cells_of(height), VerticalParameters(max_steps=len(edges)))
    assert sorted(found.distances_m) == pytest.approx(edges, abs=0.1)
    if len(edges) == 2:
        np.testing.assert_allclose(found.rises, [0.1, 0.05], atol=0.01)


def cells_in_view(height, width, nearest_m, farthest_m):
    """Cells that a camera sees, weighted by their nearness; the view widens by twice `width`."""
    x, y = (
        each.ravel()
        for each in np.meshgrid(np.arange(-1.5, 1.6, 0.15), np.arange(nearest_m, farthest_m, 0.15))
    )
    x, y = (each[np.abs(x) < width * y] for each in (x, y))
    weight = 1 / (x * x + y * y)
    return np.column_stack((x, y, height(x, y), weight / weight.sum()))


def test_the_direction_of_steps_is_that_of_several():
    # A single step fits better across another direction.
    cells = cells_in_view(
        together(
            tilted(0.0, 0.22),
            terraces(3.4, 4.0, 4.6, step_m=-0.2),
            lambda x, y: 0.03 * np.sin(2 * x - 1) * np.cos(1.5 * y),
        ),
        0.4,
        2.9,
        7,
    )
    p = VerticalParameters()
    by_one = module._find_steps(cells, replace(p, first_turns=1))
    assert abs(math.degrees(by_one.turn)) == pytest.approx(15)
    found = module._find_steps(cells, p)
    assert found.turn == 0
    assert found.cost < 0.9 * by_one.cost
    np.testing.assert_allclose(found.rises, [0, 0.22], atol=0.01)


def test_steps_are_placed_again_beside_those_found_later():
    # With the first one alone, the second seems to lie between two.
    edges = (1.4, 2.4, 3.3, 4.4)
    cells = cells_in_view(terraces(*edges, step_m=0.3), 0.6, 0.8, 7)
    found = module._find_steps(cells, VerticalParameters())
    assert sorted(found.distances_m) == pytest.approx(edges, abs=0.12)


def layer_of(rows, columns, cell_m, information=1e12, heights_m=None):
    """A layer of which the cells at some rows and columns before the camera are seen."""
    shape = max(rows) + 1, 2 * max(map(abs, columns)) + 1
    seen = np.zeros(shape, bool)
    at = np.array(rows) - 2, np.array(columns) + shape[1] // 2
    seen[at] = True
    nothing = np.zeros(shape, np.float32)
    heights, known = nothing.copy(), nothing.copy()
    heights[at] = np.arange(len(rows)) if heights_m is None else heights_m
    known[at] = information
    positions = MapPositions(nothing, nothing, shape, cell_m, -(shape[1] // 2), 2)
    return Layer(
        slice(0, 0),
        positions,
        seen,
        seen,
        seen,
        nothing,
        nothing,
        nothing,
        known,
        heights,
        nothing,
    )


def test_cells_count_by_their_area_nearness_and_information():
    near = layer_of([2, 10, 10, 20], [0, 0, 0, 0], 0.1)
    sideways = layer_of([10, 10], [-6, 6], 0.4)
    unsure = layer_of([16], [0], 0.4, information=100.0 / 0.2**2)
    parameters = replace(PARAMETERS, shared_pixels=100.0)
    cells = module._weighted_cells([near, sideways, unsure], parameters)
    across, forward, height, weight = cells.T
    np.testing.assert_allclose(across, [0, 0, 0, -2.4, 2.4, 0], atol=1e-9)
    np.testing.assert_allclose(forward, [0.2, 1, 2, 4, 4, 6.4])
    np.testing.assert_allclose(height, [0, 2, 3, 0, 1, 0])
    assert weight.sum() == pytest.approx(1)
    # Nearer than 0.3 m, nothing counts more. Half as much where the noise is 0.2 m.
    far = 16 / (4**2 + 2.4**2)
    expected = [1 / 0.3**2, 1, 1 / 4, far, far, 16 / 6.4**2 / 2]
    np.testing.assert_allclose(weight / weight[1], expected, rtol=1e-5)


def test_each_layer_counts_beyond_the_nearer_ones_as_far_as_the_range():
    p = replace(PARAMETERS.vertical, range_m=2.5, nearest_m=0.5)
    near, far = layer_of([2, 4, 8], [0, 0, 0], 0.125), layer_of([2, 4, 8, 10, 11], [0] * 5, 0.25)
    behind = layer_of([3], [0], 0.25)
    cells = module._weighted_cells([near, far, behind], replace(PARAMETERS, vertical=p))
    assert cells[:, 1].tolist() == [1.0, 2.0, 2.5]
    assert module._weighted_cells([], PARAMETERS).shape == (0, 4)


def test_many_cells_are_thinned():
    layer = layer_of(range(2, 32), [0] * 30, 0.1)
    p = replace(PARAMETERS.vertical, max_cells=10)
    forward = module._weighted_cells([layer], replace(PARAMETERS, vertical=p))[:, 1]
    np.testing.assert_allclose(forward, np.arange(2, 32, 3) * 0.1)


@pytest.mark.parametrize('missing', [0, 1])
def test_the_least_number_of_cells_gives_a_vertical(missing):
    columns = np.repeat([-3, 3], 3)
    layer = layer_of([5, 6, 7, 5, 6, 7], columns, 0.1, heights_m=0.02 * columns)
    p = replace(PARAMETERS.vertical, min_cells=6 + missing)
    (found,) = likely_verticals([layer], POSED.level_ground, replace(PARAMETERS, vertical=p))
    assert apart_deg(found, POSED.up if missing else normal_of(0.2, 0.0)) < 0.1


def test_cells_with_little_information_hardly_count():
    terrain, *_ = POSED.survey(flat)
    unknown, trusted = [], []
    for layer in terrain.layers:
        rows, columns = np.indices(layer.ground_m.shape)
        known = rows < 0.3 * len(layer.ground_m)
        ground_m = np.where(known, layer.ground_m, 0.2 * columns * layer.positions.cell_m)
        information = np.where(known, np.float32(1e9), np.float32(10))
        unknown.append(replace(layer, ground_m=ground_m, information=information))
        trusted.append(replace(unknown[-1], information=np.full_like(information, 1e9)))
    assert apart_deg(vertical_of(unknown), POSED.up) < 1
    assert apart_deg(vertical_of(trusted), POSED.up) > 3


@pytest.mark.parametrize(('angle', 'start'), [(26, 3.0), (-26, 1.8)])
def test_slope_ahead_does_not_count_over_another_plane(angle, start):
    assert apart_deg(vertical(bank(angle, start), ground=LEANING), POSED.up) < 2


@pytest.mark.parametrize(('angle', 'start'), [(26, 3.0), (-26, 1.8)])
def test_slope_ahead_does_not_count_from_another_slope(angle, start):
    height = together(tilted(0.1, 0.1), bank(angle, start))
    assert apart_deg(vertical(height), normal_of(0.1, 0.1)) < 2


def test_rocks_do_not_count():
    generator = np.random.default_rng(1)
    places = zip(
        generator.uniform(-1.5, 1.5, 12), generator.uniform(1, 5, 12),
        generator.uniform(0.2, 0.5, 12), generator.uniform(0.1, 0.4, 12), strict=True,
    )  # fmt: skip
    rocks = together(*(block(*place) for place in places))
    assert apart_deg(vertical(rocks), POSED.up) < 0.5
    assert apart_deg(vertical(together(rocks, bank(26, 3.5))), POSED.up) < 2


def test_gentle_swell_hardly_counts():
    def swell(x, y):
        return 0.04 * np.sin(2 * np.pi * x / 3 + 1) * np.sin(2 * np.pi * y / 3)

    assert apart_deg(vertical(swell), POSED.up) < 1.5


def test_noise_hardly_counts():
    disparity, _, _ = POSED.look(bank(26, 3.0))
    noise = np.random.default_rng(0).normal(0, 0.1, disparity.shape)
    noisy = np.where(disparity > 0, np.maximum(disparity + noise, 0), 0).astype(np.float32)
    terrain = survey(POSED.stereo(noisy, 0.1), PARAMETERS)
    assert apart_deg(vertical_of(terrain.layers), POSED.up) < 2


def test_with_too_little_ground_the_plane_keeps_its_vertical():
    assert vertical_of((), LEANING) == LEANING.up
    disparity, x, y = POSED.look(flat)
    disparity[np.hypot(x, y - 2) > 0.06] = 0
    assert disparity.any()
    terrain = survey(POSED.stereo(disparity, 0.1), PARAMETERS)
    assert terrain.layers
    assert vertical_of(terrain.layers, LEANING) == LEANING.up


def test_ground_behind_the_camera_does_not_count():
    # Half of the ground that the camera sees lies behind it.
    down = PosedCamera(pitch_deg=90.0)
    assert apart_deg(vertical(lambda x, y: np.where(y < -0.05, -0.3 * y, 0), down), down.up) < 0.5


def test_ground_far_ahead_does_not_count():
    low = PosedCamera(pitch_deg=5.0)
    assert apart_deg(vertical(bank(3, 12.0), low), low.up) < 0.3


def test_ground_far_off_the_plane_does_not_turn_the_vertical():
    assert apart_deg(vertical(tilted(0.4, 0.0)), normal_of(0.0, 0.0)) < 1e-3
