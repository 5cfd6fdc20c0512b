"""Terrain without rocks: the ground height at every position."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.simulation import streams
from rover_obstacle_detection.simulation.description import Crater, TerrainParameters
from rover_obstacle_detection.simulation.landforms import Landforms
from rover_obstacle_detection.simulation.noise import Tile, fractal_tile

Floats = NDArray[np.float32]

_HILLS_BEGIN_M, _HILLS_FULL_M = 25.0, 120.0
_CLODS_FADE_M, _CLODS_END_M = 15.0, 30.0
"""Clods fade out here: the mesh of farther ground is too coarse for them."""


@dataclass(frozen=True)
class Apron:
    """Soil heaped against a rock."""

    x_m: float
    y_m: float
    radius_m: float
    height_m: float


class Terrain:
    """Ground height in a world with x ahead, y left and z up.

    The rover starts at the origin, facing along x, at height 0.

    Parameters
    ----------
    parameters : TerrainParameters
    seed : int
    """

    def __init__(self, parameters: TerrainParameters, seed: int) -> None:
        rng = np.random.default_rng([seed, streams.TERRAIN])
        self._parameters = parameters
        self._hills = fractal_tile(rng, 620.0, 240.0, 12.0, 2.2)
        self._relief = fractal_tile(rng, 41.0, 12.0, 0.8, 2.2)
        self._rough = fractal_tile(rng, 6.3, 1.2, 0.08, 1.9)
        self._clods = fractal_tile(rng, 2.9, 0.12, 0.012, 1.5)
        self._patches = fractal_tile(rng, 23.0, 6.0, 0.6, 1.8)
        self._warp = fractal_tile(rng, 53.0, 12.0, 1.5, 2.0)
        self._phase = rng.uniform(0, 2 * math.pi, 2)
        self._turn = rng.uniform(-0.6, 0.6, 2)
        self.landforms = Landforms(parameters, seed)
        self._crater_waves = rng.uniform(0, 2 * math.pi, (max(len(parameters.craters), 1), 4))
        self._offset = np.float32(0)
        self._aprons: _ApronGrid | None = None
        self._offset = self.height(np.zeros(1, np.float32), np.zeros(1, np.float32))[0]

    def heap(self, aprons: list[Apron]) -> None:
        """Set the soil heaped against rocks, replacing any set before."""
        self._aprons = _ApronGrid(aprons) if aprons else None

    def height(self, x_m: Floats, y_m: Floats) -> Floats:
        """Return the ground height (m) at positions of any shape."""
        p = self._parameters
        height = np.full(np.shape(x_m), -self._offset, np.float32)
        distance = np.hypot(x_m, y_m)
        far = _smooth_step((distance - _HILLS_BEGIN_M) / (_HILLS_FULL_M - _HILLS_BEGIN_M))
        for amplitude, tile in (
            (p.hills_m * far, self._hills),
            (p.relief_m, self._relief),
            (p.roughness_m, self._rough),
        ):
            if np.any(amplitude):
                height += amplitude * tile.smooth(x_m, y_m)
        if p.clods_m:
            fade = (_CLODS_END_M - distance) / (_CLODS_END_M - _CLODS_FADE_M)
            near = np.clip(fade, 0, 1).astype(np.float32)
            waves = self._clods.smooth(x_m, y_m)
            # Rectified waves: lumps on smooth ground, no pits.
            lumps = 0.65 * (waves + np.sqrt(waves * waves + 0.4))
            height += p.clods_m * near * self.cloddiness(x_m, y_m) * lumps
        height += self._slope(x_m, y_m)
        if p.dune_height_m or p.ripple_height_m:
            height += self._waves(x_m, y_m)
        for crater, waves in zip(p.craters, self._crater_waves, strict=False):
            height += _crater(crater, waves, x_m, y_m)
        if self.landforms.present:
            height += self.landforms.height(x_m, y_m)
        if self._aprons is not None:
            height += self._aprons.height(x_m, y_m)
        return height.astype(np.float32)

    def cloddiness(self, x_m: Floats, y_m: Floats) -> Floats:
        """Return the density of clods, from 0.15 (smooth sand) to 1.75."""
        patch = self._patches.linear(x_m, y_m)
        return np.asarray(0.15 + 1.6 * _smooth_step(patch * 0.7 + 0.35), np.float32)

    def _slope(self, x_m: Floats, y_m: Floats) -> Floats | float:
        p = self._parameters
        if p.slope_deg == 0:
            return 0.0
        turn = math.radians(p.slope_turn_deg)
        along = np.asarray(x_m * math.cos(turn) + y_m * math.sin(turn) - p.slope_start_m)
        bend = 0.25
        ramp = _soft_plus(along, bend) - _soft_plus(along - p.slope_length_m, bend)
        return np.asarray(math.tan(math.radians(p.slope_deg)) * ramp, np.float32)

    def _waves(self, x_m: Floats, y_m: Floats) -> Floats:
        p = self._parameters
        warp = self._warp.smooth(x_m, y_m)
        patch = 0.6 + 0.4 * np.tanh(self._patches.smooth(x_m, y_m))
        dunes, ripples = (
            x_m * np.float32(math.cos(turn)) + y_m * np.float32(math.sin(turn))
            for turn in self._turn
        )
        dune_angle = 2 * math.pi * dunes / p.dune_length_m + self._phase[0] + 0.45 * warp
        ripple_angle = 2 * math.pi * ripples / p.ripple_length_m + self._phase[1] + 2.5 * warp
        height = 0.5 * p.dune_height_m * _wind_blown(dune_angle)
        height += 0.5 * p.ripple_height_m * patch * _wind_blown(ripple_angle)
        return height.astype(np.float32)


def _wind_blown(angle: NDArray[np.floating]) -> NDArray[np.float64]:
    # Phase modulation steepens the lee side.
    return np.asarray(np.sin(angle + 0.35 * np.sin(angle)), np.float64)


def _smooth_step(t: NDArray[np.floating]) -> Floats:
    clipped = np.clip(t, 0, 1).astype(np.float32)
    return np.asarray(clipped * clipped * (3 - 2 * clipped), np.float32)


def _soft_plus(t: NDArray[np.floating], width: float) -> Floats:
    return np.asarray(width * np.logaddexp(0, t / width), np.float32)


def _crater(crater: Crater, waves: NDArray[np.float64], x_m: Floats, y_m: Floats) -> Floats:
    dx, dy = x_m - crater.ahead_m, y_m - crater.left_m
    angle = np.arctan2(dy, dx)
    # Harmonics make the outline irregular.
    outline = np.ones(np.shape(x_m))
    for number, phase in enumerate(waves, 2):
        outline += 0.035 * np.sin(number * angle + phase)
    radius = np.hypot(dx, dy) / (0.5 * crater.diameter_m * outline)
    rim = 0.12 * crater.depth_m
    bowl = -crater.depth_m + (crater.depth_m + rim) * np.minimum(radius, 1.0) ** 2.2
    outside = rim * np.maximum(radius, 1.0) ** -3.5
    # Rounds the rim.
    over = _smooth_step((radius - 0.88) / 0.24)
    return np.asarray(bowl * (1 - over) + outside * over, np.float32)


class _ApronGrid:
    """Apron heights on a grid; 0 outside."""

    FINEST_M = 0.02
    MOST_CELLS = 4000
    """Cells per side. Larger areas get coarser cells."""

    def __init__(self, aprons: list[Apron]) -> None:
        xs, ys = [apron.x_m for apron in aprons], [apron.y_m for apron in aprons]
        extent = max(max(xs) - min(xs), max(ys) - min(ys))
        cell = max(self.FINEST_M, extent / self.MOST_CELLS)
        reach = max(apron.radius_m for apron in aprons) * 3 + 4 * cell
        self._x0, self._y0 = min(xs) - reach, min(ys) - reach
        columns = math.ceil((max(xs) + reach - self._x0) / cell)
        rows = math.ceil((max(ys) + reach - self._y0) / cell)
        grid = np.zeros((rows, columns), np.float32)
        for apron in aprons:
            span = 3 * apron.radius_m
            i0, i1 = (int((apron.y_m + s - self._y0) / cell) for s in (-span, span))
            j0, j1 = (int((apron.x_m + s - self._x0) / cell) for s in (-span, span))
            y = self._y0 + cell * np.arange(i0, i1, dtype=np.float32)[:, np.newaxis]
            x = self._x0 + cell * np.arange(j0, j1, dtype=np.float32)[np.newaxis]
            square = ((x - apron.x_m) ** 2 + (y - apron.y_m) ** 2) / apron.radius_m**2
            patch = grid[i0:i1, j0:j1]
            np.maximum(patch, apron.height_m * np.exp(-square), out=patch)
        self._x1 = self._x0 + (columns - 1) * cell
        self._y1 = self._y0 + (rows - 1) * cell
        size = max(rows, columns) + 4
        values = np.zeros((size, size), np.float32)
        values[:rows, :columns] = grid
        self._tile = Tile(values, size * cell)

    def height(self, x_m: Floats, y_m: Floats) -> Floats:
        inside = (x_m > self._x0) & (x_m < self._x1) & (y_m > self._y0) & (y_m < self._y1)
        result = np.zeros(np.shape(x_m), np.float32)
        result[inside] = self._tile.smooth(
            (x_m[inside] - self._x0).astype(np.float32),
            (y_m[inside] - self._y0).astype(np.float32),
        )
        return result
