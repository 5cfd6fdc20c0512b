"""The vertical where nobody tells it: the rover stands level on the ground before it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.noise import SHARED_PIXELS
from rover_obstacle_detection.detection.terrain.elevation_map import ground_axes
from rover_obstacle_detection.detection.terrain.survey import Layer

_SAMPLES = 2000
_RANGE_M = 12.0
_ITERATIONS = 5
_RELIEF_M = 0.03
_NEARNESS = 2.0
_FIRST = 0.02
_HINGES = 7
_TURNS = tuple(math.radians(turn) for turn in (-30, -15, 0, 15, 30))
_THINNING = 4
_FEW = 500
_BEND_WIDTH_M = 0.15
_BEND_WIDTHS_M = (0.05, 0.15, 0.3, 0.5)
_FINER = 3
_COST_TOLERANCE = 0.1
_MIN_BEND_DEG = 6.0
_MAX_COST_SHARE = 0.6
_LEVEL_SHARE = 0.5
# A cell whose height is known to so much counts half, one with ten times that hardly.
_KNOWN_M = 0.2

Cells = NDArray[np.float64]


def estimate_vertical(layers: Sequence[Layer], ground: GroundPlane) -> tuple[float, float, float]:
    """Find the normal of the ground that the rover stands on.

    Parameters
    ----------
    layers : sequence of Layer
    ground : GroundPlane
        The plane over which the layers are measured.

    Returns
    -------
    tuple of float
        Unit vector in the left optical frame.

    Notes
    -----
    Undulation tilts a small patch of ground more than a large one, so all that is seen within
    12 m is fitted, by its share of the view from above and the nearer the more. But a slope ahead
    is no part of what the rover stands on: where planes with a bend more or less across the view
    fit much better, their near side counts, together with a plane through the nearer half of what
    lies before the bend. A bend of ground is no edge: its rise grows over up to half a metre on
    either side (softplus), and an early wide bend fits about as well as a later one of half the
    angle, so the answer is the mean of all bends, each by how well it fits. All fits are
    iteratively reweighted least squares with Cauchy weights.
    """
    cells = _cells(layers)
    if len(cells) < 20:
        return ground.up
    thinned = cells[:: _THINNING if len(cells) > _FEW else 1]
    bend = _mean_bend(thinned)
    if bend.least_cost < _MAX_COST_SHARE * _fit(thinned, None, 1.0)[1] and bend.is_clear:
        before = np.array([bend.rise_right, bend.rise_before])
        turned = _turned(cells, bend.turn)
        first = np.quantile(turned[:, 1], _FIRST)
        level = turned[turned[:, 1] < first + _LEVEL_SHARE * (bend.distance_m - first)]
        if len(level) >= 20:
            before[1] = (before[1] + _fit(level, None, 1.0)[0][2]) / 2
        rises = before @ _rotation(bend.turn)
    else:
        rises = _fit(cells, None, 1.0)[0][1:3]
    right, forward = ground_axes(ground)
    normal = np.asarray(ground.normal) - rises[0] * right - rises[1] * forward
    x, y, z = (float(value) for value in normal / np.linalg.norm(normal))
    return x, y, z


@dataclass(frozen=True)
class _Bend:
    """Ground that bends across a direction turned to the right (radians)."""

    turn: float
    distance_m: float
    rise_right: float
    rise_before: float
    rise_beyond: float
    least_cost: float

    @property
    def is_clear(self) -> bool:
        angle = math.atan(self.rise_beyond) - math.atan(self.rise_before)
        return abs(math.degrees(angle)) > _MIN_BEND_DEG


def _mean_bend(cells: Cells) -> _Bend:
    """Mean of the bends near the one that fits best, each by how well it fits."""
    first, last = np.quantile(cells[:, 1], (_FIRST, 1 - _FIRST))
    hinges_m = np.geomspace(1.3 * first, 0.75 * last, _HINGES)

    def cost(bend: tuple[float, float]) -> float:
        turn, hinge_m = bend
        return _fit(_turned(cells, turn), hinge_m, _BEND_WIDTH_M)[1]

    turn, best_m = min(product(_TURNS, hinges_m), key=cost)
    turned = _turned(cells, turn)
    around_m = best_m * (hinges_m[1] / hinges_m[0]) ** (np.arange(-_FINER, _FINER + 1) / _FINER)
    around_m = np.unique(np.clip(around_m, first, last))
    rows = []
    for hinge_m, width_m in product(around_m, _BEND_WIDTHS_M):
        (_, right, near, further), fit_cost = _fit(turned, hinge_m, width_m)
        under_rover = further / (1 + math.exp(hinge_m / width_m))
        rows.append((hinge_m, right, near + under_rover, near + further, fit_cost))
    bends = np.array(rows)
    costs = bends[:, -1]
    weight = np.exp((costs.min() - costs) / (_COST_TOLERANCE * max(costs.min(), 1e-9)))
    distance_m, right, before, beyond, _ = weight @ bends / weight.sum()
    return _Bend(turn, distance_m, right, before, beyond, costs.min())


def _rotation(turn: float) -> NDArray[np.float64]:
    """From right and forward to across and along a direction turned to the right."""
    return np.array(
        [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]], np.float64
    )


def _turned(cells: Cells, turn: float) -> Cells:
    return np.column_stack((cells[:, :2] @ _rotation(turn).T, cells[:, 2:]))


def _cells(layers: Sequence[Layer]) -> Cells:
    """Rows of right, forward, height (m) and weight of the seen cells, nearest layer first."""
    parts: list[Cells] = []
    nearest_m = -math.inf
    for layer in layers:
        positions = layer.positions
        rows, columns = np.nonzero(layer.seen)
        forward = (rows + positions.first_row) * positions.cell_m
        across = (columns + positions.first_column) * positions.cell_m
        own = (forward > max(nearest_m, 0.05)) & (forward <= _RANGE_M)
        if not own.any():
            continue
        nearest_m = float(forward[own].max())
        height = layer.ground_m[rows, columns]
        distance = np.maximum(np.hypot(across, forward), 0.3)
        known = layer.information[rows, columns] * np.float32(_KNOWN_M**2)
        weight = positions.cell_m**2 / distance**_NEARNESS * known / (known + SHARED_PIXELS)
        parts.append(np.column_stack((across, forward, height, weight))[own].astype(np.float64))
    if not parts:
        return np.empty((0, 4))
    cells = np.concatenate(parts)
    cells = cells[:: max(1, len(cells) // _SAMPLES)]
    cells[:, 3] /= cells[:, 3].sum()
    return cells


def _fit(cells: Cells, hinge_m: float | None, width_m: float) -> tuple[NDArray[np.float64], float]:
    """Level, rise to the right, rise forward, and further rise beyond the hinge; and its cost."""
    across, forward, height, share = cells.T
    beyond = np.zeros_like(forward)
    if hinge_m is not None:
        beyond = width_m * np.logaddexp(0, (forward - hinge_m) / width_m)
    design = np.column_stack((np.ones_like(across), across, forward, beyond))
    weight = share
    solution = np.zeros(4)
    for _ in range(_ITERATIONS):
        weighted = design * weight[:, np.newaxis]
        normal_matrix = weighted.T @ design
        normal_matrix[np.diag_indices(4)] += 1e-6 * np.trace(normal_matrix)
        solution = np.linalg.solve(normal_matrix, weighted.T @ height)
        squares = ((height - design @ solution) / _RELIEF_M) ** 2
        weight = share / (1 + squares)
    return solution, float(np.sum(share * np.log1p(squares)))
