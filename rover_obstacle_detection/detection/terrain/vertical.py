"""The vertical, estimated as the normal of the visible ground that the rover stands on."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.elevation_map import ground_axes
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.terrain import Layer
from rover_obstacle_detection.detection.terrain.vertical_parameters import VerticalParameters

Cells = NDArray[np.float64]
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


def _vertical(rises: NDArray[np.float64], ground: GroundPlane, p: VerticalParameters) -> Vector:
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


def _rises_before(bend: _Bend, cells: Cells, p: VerticalParameters) -> NDArray[np.float64]:
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
    hinges_m = np.geomspace(p.first_hinge * first, p.last_hinge * last, p.hinges)

    turns = [math.radians(turn_deg) for turn_deg in p.turns_deg]
    every_turn = np.stack([_turned(cells, each) for each in turns])
    each_turn, each_hinge_m = (
        np.repeat(every_turn, p.hinges, axis=0),
        np.tile(hinges_m, len(turns)),
    )
    costs = _fits(each_turn, each_hinge_m, np.full_like(each_hinge_m, p.bend_width_m), p)[1]
    best = int(np.argmin(costs))
    turn, best_m = turns[best // p.hinges], each_hinge_m[best]
    turned = each_turn[best : best + 1]
    steps = np.arange(-p.refinement_steps, p.refinement_steps + 1) / p.refinement_steps
    around_m = best_m * (hinges_m[1] / hinges_m[0]) ** steps
    around_m = np.unique(np.clip(around_m, first, last))
    hinges_m, widths_m = (
        each.ravel() for each in np.meshgrid(around_m, p.bend_widths_m, indexing='ij')
    )
    (_, right, near, further), costs = (each.T for each in _fits(turned, hinges_m, widths_m, p))
    under_rover = further * np.exp(-np.logaddexp(0, hinges_m / widths_m))
    bends = np.stack((hinges_m, right, near + under_rover, near + further))
    weight = np.exp((costs.min() - costs) / (p.cost_tolerance * max(costs.min(), 1e-9)))
    distance_m, rise_right, before, beyond = (bends @ weight / weight.sum()).tolist()
    return _Bend(turn, distance_m, rise_right, before, beyond, float(costs.min()))


class _Steps(NamedTuple):
    """Ground with steps up or down at some distances, and one slope before and behind them.

    All are across a direction turned to the right, radians.
    """

    turn: float
    distances_m: tuple[float, ...]
    rises: NDArray[np.float64]
    cost: float


def _find_steps(cells: Cells, p: VerticalParameters) -> _Steps:
    """Find the steps that fit best, one after the other while each improves the fit by much."""
    first, last = np.quantile(cells[:, 1], (p.tail_share, 1 - p.tail_share))
    distances_m = np.geomspace(first, p.last_hinge * last, p.step_distances + 1)[1:]
    ratio = distances_m[1] / distances_m[0]
    around = ratio ** np.linspace(-1, 1, p.step_distances)

    def refined(steps: _Steps) -> _Steps:
        *others_m, last_m = steps.distances_m
        moved = _with_step(cells, steps.turn, tuple(others_m), last_m * around, p)
        return min(steps, moved, key=_cost)

    def with_one_more(turn: float, others_m: tuple[float, ...]) -> _Steps:
        return refined(_with_step(cells, turn, others_m, distances_m, p))

    turns = [math.radians(turn_deg) for turn_deg in p.turns_deg]
    single = [_with_step(cells, turn, (), distances_m, p) for turn in turns]
    # One step says little about the direction, so the second decides.
    found = [refined(steps) for steps in sorted(single, key=_cost)[: p.first_turns]]
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
    turn: float,
    steps_m: tuple[float, ...],
    distances_m: NDArray[np.float64],
    p: VerticalParameters,
) -> _Steps:
    """Add the step that fits best to some others, all across a direction turned to the right."""
    turned = _turned(cells, turn)
    design = _step_designs(turned, steps_m, distances_m, p)
    solutions, costs = _solve(design, turned, p)
    best = int(np.argmin(costs))
    rises = solutions[best, 1:3] @ _rotation(turn)
    distances = (*steps_m, float(distances_m[best]))
    return _Steps(turn, distances, np.asarray(rises), float(costs[best]))


def _step_designs(
    cells: Cells,
    steps_m: tuple[float, ...],
    distances_m: NDArray[np.float64],
    p: VerticalParameters,
) -> NDArray[np.float64]:
    """Design with the given steps and one at each of the distances, shape (n, unknowns, cells)."""
    across, forward = cells[:, 0], cells[:, 1]
    places_m = np.concatenate((steps_m, distances_m))
    rise = 0.5 + 0.5 * np.tanh((forward - places_m[:, np.newaxis]) / p.step_width_m)
    known = np.stack((np.ones_like(across), across, forward, *rise[: len(steps_m)]))
    design = np.empty((len(distances_m), len(known) + 1, len(cells)))
    design[:, :-1], design[:, -1] = known, rise[len(steps_m) :]
    return design


def _rotation(turn: float) -> NDArray[np.float64]:
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


def _fit(cells: Cells, p: VerticalParameters) -> tuple[NDArray[np.float64], float]:
    """Level, rise to the right and rise forward of a plane; and its cost."""
    plane = np.stack((np.ones(len(cells)), cells[:, 0], cells[:, 1]))
    solutions, costs = _solve(plane[np.newaxis], cells, p)
    return solutions[0], float(costs[0])


def _fits(
    cells: Cells, hinges_m: Cells, widths_m: Cells, p: VerticalParameters
) -> tuple[Cells, Cells]:
    """Fit a bend with each hinge and width, shape (n, 4) and (n,).

    Level, rise to the right, rise forward, and further rise beyond the hinge; and the cost. The
    cells have shape (n, cells, 4), or (1, cells, 4) if all fits have the same. All have the same
    heights and weights.
    """
    across, forward = cells[..., 0], cells[..., 1]
    design = np.empty((len(hinges_m), 4, cells.shape[1]))
    design[:, 0], design[:, 1], design[:, 2] = 1, across, forward
    beyond = (forward - hinges_m[:, np.newaxis]) / widths_m[:, np.newaxis]
    # softplus
    design[:, 3] = np.log1p(np.exp(-np.abs(beyond))) + np.maximum(beyond, 0)
    design[:, 3] *= widths_m[:, np.newaxis]
    return _solve(design, cells[0], p)


def _solve(
    design: NDArray[np.float64], cells: Cells, p: VerticalParameters
) -> tuple[Cells, Cells]:
    """Solve for the heights of the cells by each design, shape (n, unknowns, cells)."""
    # Half the time of float64; for ground in view, the results hardly differ.
    design, cells = design.astype(np.float32), cells.astype(np.float32)
    height, share = cells[:, 2], cells[:, 3]
    ridge = 1e-6 * np.identity(design.shape[1])
    transposed, weighted = design.transpose(0, 2, 1), np.empty_like(design)
    weight = np.broadcast_to(share, (len(design), len(height)))
    for _ in range(p.iterations):
        np.multiply(design, weight[:, np.newaxis], out=weighted)
        normal_matrix = (weighted @ transposed).astype(np.float64)
        normal_matrix += (
            np.trace(normal_matrix, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * ridge
        )
        solution = np.linalg.solve(normal_matrix, (weighted @ height)[..., np.newaxis])[..., 0]
        residual = height - (solution[:, np.newaxis].astype(np.float32) @ design)[:, 0]
        residual /= np.float32(p.relief_m)
        squares = residual * residual
        weight = share / (1 + squares)
    return np.asarray(solution, np.float64), np.asarray((share * np.log1p(squares)).sum(axis=1))
