"""The vertical, estimated as the normal of the visible ground that the rover stands on."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.elevation_map import ground_axes
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.terrain import Layer
from rover_obstacle_detection.detection.terrain.vertical_parameters import VerticalParameters

Cells = NDArray[np.float64]
"""Right, forward, height (metres) and weight of each cell, shape (n, 4)."""
Numbers = NDArray[np.float64]
Vector = tuple[float, float, float]


def likely_verticals(
    layers: Sequence[Layer], ground: GroundPlane, parameters: TerrainParameters
) -> list[Vector]:
    """Estimate the normal of the ground that the rover stands on.

    Parameters
    ----------
    layers : sequence of Layer
    ground : GroundPlane
        The plane over which the layers are measured.
    parameters : TerrainParameters

    Returns
    -------
    list of tuple of float
        Unit vectors in the left optical frame. More than one only where a slope
        and steps between level ground fit equally well.

    Notes
    -----
    Undulation tilts a small patch of ground more than a large one. So all visible ground within
    range is fitted, weighted by its area seen from above and by its nearness.

    A slope ahead is not what the rover stands on. So two planes that meet in a bend are fitted as
    well. If they fit much better, the near plane counts, averaged with a plane through the nearer
    half of the ground before the bend. Ground bends gradually: its slope changes over up to a
    metre (softplus). An early wide bend fits about as well as a later one of half the angle, so
    the bend is the mean of all bends, weighted by fit.

    A ledge or a terrace ahead would tilt a plane as well. So steps between levels of one slope are
    fitted too. If they fit much better than a plane and a bend, that slope counts. If they fit
    just better, either may be true: stairs look like the slope that runs along them.

    All fits are iteratively reweighted least squares with Cauchy weights.
    """
    p = parameters.vertical
    cells = _weighted_cells(layers, parameters)
    if len(cells) < p.min_cells:
        return [ground.up]
    thinned = cells[:: p.search_thinning if len(cells) > p.search_cells else 1]
    bend = _mean_bend(thinned, p)
    flat_cost = _fit(thinned, p)[1]
    best_cost = min(flat_cost, bend.min_cost)
    steps = _find_steps(thinned, p) if best_cost > p.even_cost else None
    likely = []
    if not steps or steps.cost >= p.max_cost_share * best_cost:
        if bend.min_cost < p.max_cost_share * flat_cost and bend.angle_deg > p.min_bend_deg:
            likely.append(_rises_before(bend, cells, p))
        else:
            likely.append(_fit(cells, p)[0][1:])
    if steps and steps.cost < best_cost:
        likely.append(steps.rises)
    return [_vertical(rises, ground, p) for rises in likely]


def _vertical(rises: Numbers, ground: GroundPlane, p: VerticalParameters) -> Vector:
    """Return the normal of ground that rises to the right and forward over the plane."""
    right, forward = ground_axes(ground)
    normal = np.asarray(ground.normal) - rises[0] * right - rises[1] * forward
    normal /= np.linalg.norm(normal)
    if float(normal @ np.asarray(ground.normal)) < math.cos(math.radians(p.max_turn_deg)):
        # The plane lies on the nearest ground: so much can only be a drop or a wall.
        return ground.up
    x, y, z = (float(value) for value in normal)
    return x, y, z


@dataclass(frozen=True)
class _Bend:
    """Ground that bends across a direction turned to the right, radians."""

    turn: float
    distance_m: float
    rise_right: float
    rise_before: float
    rise_beyond: float
    min_cost: float

    @property
    def angle_deg(self) -> float:
        return abs(math.degrees(math.atan(self.rise_beyond) - math.atan(self.rise_before)))


def _rises_before(bend: _Bend, cells: Cells, p: VerticalParameters) -> Numbers:
    """Rise to the right and forward of the ground before a bend."""
    before = np.array([bend.rise_right, bend.rise_before])
    turned = _turned(cells, bend.turn)
    first = np.quantile(turned[:, 1], p.tail_share)
    level = turned[turned[:, 1] < first + p.level_share * (bend.distance_m - first)]
    if len(level) >= p.min_cells:
        before[1] = (before[1] + _fit(level, p)[0][2]) / 2
    return np.asarray(before @ _rotation(bend.turn))


def _mean_bend(cells: Cells, p: VerticalParameters) -> _Bend:
    """Mean of the bends near the one that fits best, weighted by fit."""
    first, last = np.quantile(cells[:, 1], (p.tail_share, 1 - p.tail_share))
    tried_m = np.geomspace(p.first_hinge * first, p.last_hinge * last, p.hinges)
    turns, hinges_m = _all_pairs(np.radians(p.turns_deg), tried_m)
    _, costs = _fit_bends(cells, turns, hinges_m, np.full_like(hinges_m, p.bend_width_m), p)
    best = int(np.argmin(costs))
    turn, best_m = float(turns[best]), hinges_m[best]
    steps = np.arange(-p.refinement_steps, p.refinement_steps + 1) / p.refinement_steps
    around_m = best_m * (tried_m[1] / tried_m[0]) ** steps
    around_m = np.unique(np.clip(around_m, first, last))
    hinges_m, widths_m = _all_pairs(around_m, p.bend_widths_m)
    solutions, costs = _fit_bends(cells, np.full_like(hinges_m, turn), hinges_m, widths_m, p)
    further, (right, near) = solutions[:, 0], _rotation(turn) @ solutions[:, 2:].T
    under_rover = further * np.exp(-np.logaddexp(0, hinges_m / widths_m))
    bends = np.stack((hinges_m, right, near + under_rover, near + further))
    weight = np.exp((costs.min() - costs) / (p.cost_tolerance * max(costs.min(), 1e-9)))
    distance_m, rise_right, before, beyond = (bends @ weight / weight.sum()).tolist()
    return _Bend(turn, distance_m, rise_right, before, beyond, float(costs.min()))


def _all_pairs(one: ArrayLike, other: ArrayLike) -> tuple[Numbers, Numbers]:
    """Return every pair of two numbers, as an array of the first and one of the second."""
    first, second = np.meshgrid(one, other, indexing='ij')
    return first.ravel(), second.ravel()


class _Steps(NamedTuple):
    """Ground with steps up or down at some distances, and one slope before and behind them.

    All are across a direction turned to the right, radians.
    """

    turn: float
    distances_m: tuple[float, ...]
    rises: Numbers
    cost: float


def _find_steps(cells: Cells, p: VerticalParameters) -> _Steps:
    """Find the steps that fit best, one after the other while each improves the fit by much."""
    first, last = np.quantile(cells[:, 1], (p.tail_share, 1 - p.tail_share))
    distances_m = np.geomspace(first, p.last_hinge * last, p.step_distances + 1)[1:]
    ratio = distances_m[1] / distances_m[0]
    around = ratio ** np.linspace(-1, 1, p.step_distances)

    def with_one_more(turn: float, others_m: tuple[float, ...]) -> _Steps:
        (added,) = _with_step(cells, [turn], distances_m[np.newaxis], p, others_m)
        around_m = added.distances_m[-1] * around[np.newaxis]
        (moved,) = _with_step(cells, [turn], around_m, p, others_m)
        return min(added, moved, key=_cost)

    turns = np.radians(p.turns_deg).tolist()
    single = _with_step(cells, turns, np.tile(distances_m, (len(turns), 1)), p)
    # One step says little about the direction, so the second decides.
    single = sorted(single, key=_cost)[: p.first_turns]
    moved_m = np.array([each.distances_m for each in single]) * around
    moved = _with_step(cells, [each.turn for each in single], moved_m, p)
    found = [min(pair, key=_cost) for pair in zip(single, moved, strict=True)]
    steps = min(found, key=_cost)
    while len(steps.distances_m) < p.max_steps:
        more = [with_one_more(each.turn, each.distances_m) for each in found]
        found = [min(more, key=_cost)]
        if found[0].cost > p.max_more_share * steps.cost:
            break
        steps = found[0]
    return _placed_again(steps, with_one_more)


def _placed_again(
    steps: _Steps, with_one_more: Callable[[float, tuple[float, ...]], _Steps]
) -> _Steps:
    """Place each step again beside those found after it."""
    for _ in steps.distances_m[1:]:
        first_m, *others_m = steps.distances_m
        kept = steps._replace(distances_m=(*others_m, first_m))
        steps = min(kept, with_one_more(steps.turn, tuple(others_m)), key=_cost)
    return steps


def _cost(steps: _Steps) -> float:
    return steps.cost


def _with_step(
    cells: Cells,
    turns: Sequence[float],
    distances_m: Numbers,
    p: VerticalParameters,
    others_m: tuple[float, ...] = (),
) -> list[_Steps]:
    """Find the step that fits best across each direction, of those at the given distances.

    Parameters
    ----------
    cells : ndarray of float64, shape (cells, 4)
    turns : sequence of float
        Directions to the right, radians. Only one if there are other steps.
    distances_m : ndarray of float64, shape (turns, n)
    p : VerticalParameters
    others_m : tuple of float
        Distances of other steps, whose heights are fitted as well.

    Returns
    -------
    list of _Steps
        One for each direction.
    """
    forward = _ahead(cells, np.asarray(turns))
    shared = np.concatenate((_plane(cells), _step(forward[:1], np.array(others_m), p)))
    own = _step(forward[:, np.newaxis], distances_m, p)
    solutions, costs = _solve(own.reshape(-1, len(cells)), shared, cells, p)
    of_turn = costs.reshape(-1, len(distances_m[0]))
    best = of_turn.argmin(axis=1) + np.arange(0, costs.size, len(distances_m[0]))
    return [
        _Steps(
            turn, (*others_m, float(distances_m.flat[at])), solutions[at, 2:4], float(costs[at])
        )
        for turn, at in zip(turns, best, strict=True)
    ]


def _step(forward: Numbers, distances_m: Numbers, p: VerticalParameters) -> Numbers:
    """Return a step of height 1 at each of the distances."""
    beyond = forward - distances_m[..., np.newaxis]
    return np.asarray(0.5 + 0.5 * np.tanh(beyond / p.step_width_m))


def _ahead(cells: Cells, turns: Numbers) -> Numbers:
    """Distance of the cells along directions turned to the right, shape (turns, cells)."""
    return np.asarray(np.stack((np.sin(turns), np.cos(turns)), axis=1) @ cells[:, :2].T)


def _rotation(turn: float) -> Numbers:
    """From right and forward to across and along a direction turned to the right."""
    return np.array(
        [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]], np.float64
    )


def _turned(cells: Cells, turn: float) -> Cells:
    return np.column_stack((cells[:, :2] @ _rotation(turn).T, cells[:, 2:]))


def _weighted_cells(layers: Sequence[Layer], parameters: TerrainParameters) -> Cells:
    """Right, forward, height (metres) and weight of the seen cells, nearest layer first."""
    p = parameters.vertical
    parts: list[Cells] = []
    nearest_m = -math.inf
    for layer in layers:
        positions = layer.positions
        rows, columns = np.nonzero(layer.seen)
        forward = (rows + positions.first_row) * positions.cell_m
        across = (columns + positions.first_column) * positions.cell_m
        own = (forward > max(nearest_m, p.nearest_m)) & (forward <= p.range_m)
        if not own.any():
            continue
        nearest_m = float(forward[own].max())
        height = layer.ground_m[rows, columns]
        distance = np.maximum(np.hypot(across, forward), p.min_distance_m)
        known = layer.information[rows, columns] * np.float32(p.known_m**2)
        area = positions.cell_m**2 / distance**p.nearness
        weight = area * known / (known + parameters.shared_pixels)
        parts.append(np.column_stack((across, forward, height, weight))[own].astype(np.float64))
    if not parts:
        return np.empty((0, 4))
    cells = np.concatenate(parts)
    cells = cells[:: max(1, len(cells) // p.max_cells)]
    cells[:, 3] /= cells[:, 3].sum()
    return cells


def _plane(cells: Cells) -> Numbers:
    """Columns of the design of a plane, shape (3, cells): its level, rises right and forward."""
    return np.stack((np.ones(len(cells)), cells[:, 0], cells[:, 1]))


def _fit(cells: Cells, p: VerticalParameters) -> tuple[Numbers, float]:
    """Level, rise to the right and rise forward of a plane; and its cost."""
    plane = _plane(cells)
    solutions, costs = _solve(plane[:1], plane[1:], cells, p)
    return solutions[0], float(costs[0])


def _fit_bends(
    cells: Cells, turns: Numbers, hinges_m: Numbers, widths_m: Numbers, p: VerticalParameters
) -> tuple[Numbers, Numbers]:
    """Fit bends across directions turned to the right, each with its hinge and width.

    Returns
    -------
    solutions : ndarray of float64, shape (n, 4)
        Further rise beyond the hinge, level, rise to the right, and rise forward.
    costs : ndarray of float64, shape (n,)
    """
    beyond = _ahead(cells, turns) - hinges_m[:, np.newaxis]
    beyond /= widths_m[:, np.newaxis]
    # softplus
    bent = np.log1p(np.exp(-np.abs(beyond))) + np.maximum(beyond, 0)
    bent *= widths_m[:, np.newaxis]
    return _solve(bent, _plane(cells), cells, p)


def _solve(
    own: Numbers, shared: Numbers, cells: Cells, p: VerticalParameters
) -> tuple[Numbers, Numbers]:
    """Fit the heights of the cells by several designs that differ in their first column.

    Parameters
    ----------
    own : ndarray of float64, shape (n, cells)
        First column of each design.
    shared : ndarray of float64, shape (m, cells)
        Their other columns.
    cells : ndarray of float64, shape (cells, 4)
    p : VerticalParameters

    Returns
    -------
    solutions : ndarray of float64, shape (n, 1 + m)
    costs : ndarray of float64, shape (n,)
    """
    # Half the time of float64; for ground in view, the results hardly differ.
    first, others, height, share = (
        each.astype(np.float32) for each in (own, shared, cells[:, 2], cells[:, 3])
    )
    # Products of the shared columns with each other and with the heights.
    sides = np.concatenate((others, height[np.newaxis]))
    products = (others[:, np.newaxis] * sides).reshape(-1, len(height))
    # The normal equations, with their right side as the last column.
    equations = np.empty((len(first), 1 + len(others), 1 + len(sides)))
    matrix = equations[:, :, :-1]
    ridge = 1e-6 * np.identity(1 + len(others))
    weight = np.broadcast_to(share, first.shape)
    for _ in range(p.iterations):
        weighted = weight * first
        equations[:, 0, 0] = np.einsum('ij,ij->i', weighted, first)
        equations[:, 0, 1:] = weighted @ sides.T
        equations[:, 1:, 0] = equations[:, 0, 1:-1]
        equations[:, 1:, 1:] = (weight @ products.T).reshape(-1, len(others), len(sides))
        matrix += np.einsum('nii->n', matrix)[:, np.newaxis, np.newaxis] * ridge
        solution = np.linalg.solve(matrix, equations[:, :, -1:])[..., 0]
        factors = solution.astype(np.float32)
        residual = height - factors[:, 1:] @ others
        residual -= factors[:, :1] * first
        residual /= np.float32(p.relief_m)
        squares = residual * residual
        weight = np.asarray(share / (1 + squares), np.float32)
    costs = (share * np.log1p(squares)).sum(axis=1)
    return np.asarray(solution), np.asarray(costs, np.float64)
