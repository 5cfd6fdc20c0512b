"""Landforms with edges: steps, trenches, plates, layered rock and wheel tracks."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation import streams
from rover_obstacle_detection.simulation.description import Step, TerrainParameters
from rover_obstacle_detection.simulation.noise import fractal_tile

Floats = NDArray[np.float32]

_FINE_ROWS = 4
"""Samples per row in the search for faces."""
_CHUNK = 1 << 18
"""Positions of plates computed at a time, which bounds memory."""
_TABLE = 64
"""Plates per side after which their random heights repeat."""
_FACE = 0.06
"""Horizontal width of the face of a layer, relative to that of the whole layer."""
_TREAD = 0.12
"""Slope of the ground between the faces of layers, relative to the uncut ground."""
_LEVEL_M, _UNEVEN_M = 0.7, 1.6
"""The rover stands on level ground; plates and layers grow over these distances."""
_OPPOSITE_M = 17.3
"""Shift of the noise of the opposite edge of a trench, so that its edges differ."""
_CLEAT_M, _CLEAT_HEIGHT_M = 0.055, 0.007
"""Spacing and height of the cleat marks in wheel tracks."""


class Landforms:
    """Height of the landforms of a scene, without the other relief.

    Parameters
    ----------
    parameters : TerrainParameters
    seed : int
    """

    def __init__(self, parameters: TerrainParameters, seed: int) -> None:
        rng = np.random.default_rng([seed, streams.LANDFORMS])
        self._parameters = parameters
        self._edge = fractal_tile(rng, 11.0, 2.5, 0.08, 2.1)
        self._layers = fractal_tile(rng, 19.0, 7.0, 0.25, 2.5)
        self._warp = fractal_tile(rng, 7.0, 1.5, 0.1, 2.0)
        # Offset along both axes, height, tilt along both axes.
        self._plates = rng.uniform(0, 1, (_TABLE * _TABLE, 5)).astype(np.float32)

    @property
    def present(self) -> bool:
        """Whether the scene has any of these landforms."""
        p = self._parameters
        return bool(p.steps or p.plate_size_m or p.layer_m or p.track_depth_m)

    @property
    def has_steps(self) -> bool:
        """Whether there are steps or trenches, whose faces need a finer mesh."""
        return bool(self._parameters.steps)

    def height(self, x_m: Floats, y_m: Floats) -> Floats:
        """Return the height (m) at positions of any shape."""
        p = self._parameters
        height = self.step_height(x_m, y_m)
        if p.layer_m:
            height = height + self._layered(x_m, y_m)
        if p.plate_size_m:
            height = height + self._plate_height(x_m, y_m)[0]
        if p.track_depth_m:
            height = height + self._tracks(x_m, y_m)
        return np.asarray(height, np.float32)

    def step_height(self, x_m: Floats, y_m: Floats) -> Floats:
        """Return the height (m) of the steps alone."""
        height = np.zeros(np.shape(x_m), np.float32)
        for rise_m, beyond in self.faces(x_m, y_m):
            height += np.float32(rise_m) * beyond
        return height

    def faces(self, x_m: Floats, y_m: Floats) -> Iterator[tuple[float, Floats]]:
        """Yield the rise (m) at each edge, and how much of it is below each position (0 to 1)."""
        for step in self._parameters.steps:
            for beyond, sign in self._edges(step, x_m, y_m):
                yield sign * step.rise_m, _smooth(beyond / step.run_m + 0.5)

    def bedrock(self, x_m: Floats, y_m: Floats) -> Floats:
        """Return where bare rock shows, from 0 (soil) to 1 (rock)."""
        p = self._parameters
        rock = np.zeros(np.shape(x_m), np.float32)
        for step in p.steps:
            for beyond, _ in self._edges(step, x_m, y_m):
                rock = np.maximum(rock, _smooth(2.5 - 2 * np.abs(beyond) / step.run_m))
        if p.layer_m:
            rock = np.maximum(rock, np.float32(0.8))
        if p.plate_size_m and p.plate_cover < 1:
            rock = np.maximum(rock, self._plate_height(x_m, y_m)[1])
        return rock

    def _edges(self, step: Step, x_m: Floats, y_m: Floats) -> Iterator[tuple[Floats, float]]:
        """Yield the distance beyond each edge and the sign of its rise."""
        turn = math.radians(step.turn_deg)
        along = (x_m - np.float32(step.ahead_m)) * np.float32(math.cos(turn)) + y_m * np.float32(
            math.sin(turn)
        )
        waviness = np.float32(step.waviness_m)
        yield along + waviness * self._edge.smooth(x_m, y_m), 1.0
        if step.width_m:
            shifted = (x_m + np.float32(_OPPOSITE_M)).astype(np.float32)
            opposite = along - np.float32(step.width_m)
            yield opposite + waviness * self._edge.smooth(shifted, y_m), -1.0

    def _layered(self, x_m: Floats, y_m: Floats) -> Floats:
        p = self._parameters
        relief = np.float32(p.layer_relief_m) * self._layers.smooth(x_m, y_m) * _grown(x_m, y_m)
        layers = relief / np.float32(p.layer_m)
        whole = np.floor(layers)
        cut = whole + _smooth((layers - whole - 0.5) / _FACE + 0.5)
        return np.asarray(p.layer_m * ((1 - _TREAD) * cut + _TREAD * layers), np.float32)

    def _plate_height(self, x_m: Floats, y_m: Floats) -> tuple[Floats, Floats]:
        """Return the height (m) of plates and cracks, and where there is a plate (0 to 1)."""
        x, y = np.ravel(x_m), np.ravel(y_m)
        height, plate = np.empty(x.shape, np.float32), np.empty(x.shape, np.float32)
        for start in range(0, x.size, _CHUNK):
            part = slice(start, start + _CHUNK)
            height[part], plate[part] = self._some_plates(x[part], y[part])
        return height.reshape(np.shape(x_m)), plate.reshape(np.shape(x_m))

    def _some_plates(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Cut the plane into the cells nearest to jittered grid points (Worley 1996)."""
        p = self._parameters
        size = np.float32(p.plate_size_m)
        wave = np.float32(0.08) * size * self._warp.smooth(x, y)
        u, v = (x + wave) / size, (y - wave) / size
        column, row = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        first = np.full(x.shape, np.inf, np.float32)
        second = first.copy()
        nearest, next_nearest = (np.zeros((x.size, 5), np.float32) for _ in range(2))
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                index = ((row + i) % _TABLE) * _TABLE + (column + j) % _TABLE
                plate = self._plates[index]
                # From the cell's centre, in units of the plate size.
                du = u - (column + j) - (0.1 + 0.8 * plate[:, 0])
                dv = v - (row + i) - (0.1 + 0.8 * plate[:, 1])
                square = (du * du + dv * dv).astype(np.float32)
                here = np.stack([du, dv, plate[:, 2], plate[:, 3], plate[:, 4]], 1)
                closest, closer = square < first, square < second
                next_nearest = np.where(
                    closest[:, None], nearest, np.where(closer[:, None], here, next_nearest)
                ).astype(np.float32)
                nearest = np.where(closest[:, None], here, nearest).astype(np.float32)
                second = np.where(closest, first, np.where(closer, square, second))
                first = np.where(closest, square, first)
        between = np.hypot(*(nearest[:, :2] - next_nearest[:, :2]).T)
        edge_m = size * (second - first) / np.maximum(2 * between, 1e-6)
        (own, own_up), (other, other_up) = (self._top(each) for each in (nearest, next_nearest))
        inside = _smooth(edge_m / np.float32(p.crack_width_m / 2))
        share = 0.5 + 0.5 * inside
        crack = np.float32(p.crack_depth_m) * (1 - inside) * np.maximum(own_up, other_up)
        height = (share * own + (1 - share) * other) * _grown(x, y) - crack
        return np.asarray(height, np.float32), np.asarray(own_up * inside, np.float32)

    def _top(self, plate: Floats) -> tuple[Floats, Floats]:
        """Return the height (m) of plates at positions relative to their centres; 1 if in view."""
        p = self._parameters
        cover = max(p.plate_cover, 1e-6)
        stands = (plate[:, 2] > 1 - cover).astype(np.float32)
        height = p.plate_height_m * (0.25 + 0.75 * (plate[:, 2] - (1 - cover)) / cover)
        tilt = math.tan(math.radians(p.plate_tilt_deg)) * math.sqrt(6)
        slant = (plate[:, :2] * (plate[:, 3:] - 0.5)).sum(1) * p.plate_size_m * tilt
        return np.asarray(stands * (height + slant), np.float32), stands

    def _tracks(self, x_m: Floats, y_m: Floats) -> Floats:
        p = self._parameters
        turn = math.radians(p.track_turn_deg)
        cosine, sine = np.float32(math.cos(turn)), np.float32(math.sin(turn))
        along = x_m * cosine + y_m * sine
        across = y_m * cosine - x_m * sine - np.float32(p.track_left_m)
        across = across + np.float32(0.04) * self._edge.linear(
            (0.3 * along).astype(np.float32), np.zeros_like(along)
        )
        height = np.zeros(np.shape(x_m), np.float32)
        half = p.track_width_m / 2
        cleats = _CLEAT_HEIGHT_M * np.sin(2 * math.pi * along / _CLEAT_M)
        for middle in (-p.track_gauge_m / 2, p.track_gauge_m / 2):
            beyond = np.abs(across - np.float32(middle)) - np.float32(half)
            rut = _smooth(-beyond / 0.04 + 0.5)
            berm = np.exp(-(((beyond - 0.035) / 0.035) ** 2))
            height += rut * (cleats - p.track_depth_m) + 0.3 * p.track_depth_m * berm
        return height


def follow_steps(
    x_m: Floats, y_m: Floats, cell_m: Floats, landforms: Landforms
) -> tuple[Floats, Floats, Floats]:
    """Add rows to a grid and move them to the faces of steps, where they would be too sparse.

    Parameters
    ----------
    x_m, y_m : ndarray of float32, shape (rows, columns)
        Grid of ground positions; rows increase away from the rover.
    cell_m : ndarray of float32, shape (rows,)
        Width of the cells.
    landforms : Landforms

    Returns
    -------
    x_m, y_m : ndarray of float32, shape (more rows, columns)
    cell_m : ndarray of float32, shape (more rows,)
    """
    rows, columns = x_m.shape
    fine = np.linspace(0, rows - 1, _FINE_ROWS * (rows - 1) + 1)
    index = np.repeat(fine[:, np.newaxis], columns, 1)
    x_fine, y_fine = (_along_rows(grid, fine) for grid in (x_m, y_m))
    for rise_m, beyond in landforms.faces(x_fine, y_fine):
        # A column may cross a winding edge several times. Rows follow the first face only: with
        # equally many rows in all columns, the cells beyond are not sheared.
        beyond = np.maximum.accumulate(beyond, axis=0)
        beyond -= beyond[0]
        crossing = int(beyond[:, columns // 2].searchsorted(0.5))
        if crossing < len(fine):
            cell = float(np.interp(fine[crossing], np.arange(rows), cell_m))
            index += abs(rise_m) / cell * beyond
    wanted = np.linspace(0, 1, math.ceil(float(index[-1].max())) + 1)
    source = np.stack([np.interp(wanted * line[-1], line, fine) for line in index.T], axis=1)
    base = np.clip(np.floor(source).astype(np.int64), 0, rows - 2)
    rest = (source - base).astype(np.float32)
    moved = [
        np.take_along_axis(grid, base, 0) * (1 - rest)
        + np.take_along_axis(grid, base + 1, 0) * rest
        for grid in (x_m, y_m)
    ]
    width = np.interp(source.mean(1), np.arange(rows), cell_m).astype(np.float32)
    return np.asarray(moved[0], np.float32), np.asarray(moved[1], np.float32), width


def _along_rows(grid: Floats, row: NDArray[np.float64]) -> Floats:
    base = np.clip(np.floor(row).astype(np.int64), 0, len(grid) - 2)
    rest = (row - base).astype(np.float32)[:, np.newaxis]
    return np.asarray(grid[base] * (1 - rest) + grid[base + 1] * rest, np.float32)


def _grown(x_m: Floats, y_m: Floats) -> Floats:
    return _smooth((np.hypot(x_m, y_m) - _LEVEL_M) / (_UNEVEN_M - _LEVEL_M))


def _smooth(t: NDArray[np.floating]) -> Floats:
    clipped = np.clip(t, 0, 1).astype(np.float32)
    return np.asarray(clipped * clipped * (3 - 2 * clipped), np.float32)
