"""Ground that the rover cannot drive over: too steep, dropping away, or too rough."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.images.components import (
    components,
    marked,
    rows_of_components,
)
from rover_obstacle_detection.detection.terrain.elevation_map import cell_means
from rover_obstacle_detection.detection.terrain.gradient import ground_height, ground_rise
from rover_obstacle_detection.detection.terrain.local_ground import smoothed
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.slope import (
    dropped_cells,
    level_heights,
    steep_cells,
)
from rover_obstacle_detection.detection.terrain.terrain import Layer, Terrain

Mask = NDArray[np.bool_]


def steep_ground(terrain: Terrain, ground: GroundPlane, parameters: TerrainParameters) -> Mask:
    """Find the pixels of ground that is steeper than the rover can climb.

    Parameters
    ----------
    terrain : Terrain
    ground : GroundPlane
        With the vertical that slopes are measured against.
    parameters : TerrainParameters
    """

    def steep(layer: Layer) -> Mask:
        cells = steep_cells(ground_rise(layer, parameters), ground, parameters)
        # A face is a cell or two wide, and smoothing takes its edges.
        size = max(1, round(2 * parameters.slope_margin_m / layer.positions.cell_m)) | 1
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
        return np.asarray(cv2.dilate(cells.astype(np.uint8), kernel) > 0)

    return _pixels_of_cells(terrain, steep) & _quiet(terrain, parameters)


def dropping_ground(terrain: Terrain, ground: GroundPlane, parameters: TerrainParameters) -> Mask:
    """Find the pixels of ground that lies deeper below its rim than the rover can step.

    Parameters
    ----------
    terrain : Terrain
    ground : GroundPlane
        With the vertical.
    parameters : TerrainParameters
    """

    def dropped(layer: Layer) -> Mask:
        cell_m = layer.positions.cell_m
        height_m, noise_m = ground_height(layer, parameters)
        max_drop_m = parameters.max_step_m + parameters.drop_noises * noise_m
        upright_m = level_heights(height_m, cell_m, ground)
        return dropped_cells(upright_m, layer.seen, cell_m, max_drop_m, parameters)

    return _pixels_of_cells(terrain, dropped) & _quiet(terrain, parameters)


def rough_ground(terrain: Terrain, obstacles: Mask, parameters: TerrainParameters) -> Mask:
    """Find the pixels of ground that is too rough, full of stones too small to be obstacles.

    Parameters
    ----------
    terrain : Terrain
    obstacles : ndarray of bool, shape (height, width)
        Obstacles do not make the ground around them rough.
    parameters : TerrainParameters

    Notes
    -----
    Roughness is the root mean square of the height above the local ground within about a wheel
    base, less what noise alone would give, as in GESTALT and other traversability maps.
    """
    limit_m = parameters.max_roughness_m
    if not limit_m:
        return np.zeros_like(obstacles)
    usable = terrain.measured & ~obstacles
    usable &= terrain.noise_m < parameters.max_noise_share * limit_m
    # A single false match is not rough ground, however high it seems to be.
    height_m = np.clip(terrain.height_m, -parameters.max_step_m, parameters.max_step_m)
    squares = np.where(usable, height_m**2 - terrain.noise_m**2, 0).astype(np.float32)

    def rough(layer: Layer) -> Mask:
        weight = (usable[layer.rows] & layer.pixels).astype(np.float32)
        mean, count = cell_means(squares[layer.rows], weight, layer.positions)
        present = (count > 0).astype(np.float32)
        sigma = max(
            parameters.roughness_scale_m / layer.positions.cell_m, parameters.min_scale_cells
        )
        square = smoothed(mean * present, sigma) / np.maximum(smoothed(present, sigma), 1e-3)
        return np.asarray(square > limit_m**2)

    return _pixels_of_cells(terrain, rough) & usable


def known_heights(terrain: Terrain, parameters: TerrainParameters) -> Mask:
    """Find the pixels whose height is known well enough that a step would show."""
    quiet = terrain.noise_m < parameters.max_noise_share * parameters.max_step_m
    return np.asarray(terrain.measured & quiet)


def tall(terrain: Terrain, parameters: TerrainParameters) -> Mask:
    """Find what is far higher than the ground can be estimated wrongly: walls, trees, vehicles.

    Parameters
    ----------
    terrain : Terrain
    parameters : TerrainParameters
    """
    noise_m = parameters.certain_noises * terrain.noise_m
    with np.errstate(invalid='ignore'):
        high = terrain.height_m > parameters.min_wall_m + noise_m
    high &= _quiet(terrain, parameters)
    if not high.any():
        return np.asarray(high)
    # What is small and high up stands on nothing: a false match.
    pixels, owner, count = components(high)
    rows = rows_of_components(pixels // high.shape[1], owner, count)
    scale = np.bincount(owner, weights=terrain.pixels_per_metre.ravel()[pixels])
    height_m = rows * np.bincount(owner) / np.maximum(scale, 1e-6)
    large = height_m > parameters.min_wall_share * parameters.min_wall_m
    return marked(high.shape, pixels[large[owner]])


def level_heights_known(terrain: Terrain, parameters: TerrainParameters) -> Mask:
    """Find the pixels that are known to lie within a step of the local ground.

    What is measured higher or lower is never free, also where no cue makes it an obstacle.
    """
    noise_m = parameters.certain_noises * terrain.noise_m
    with np.errstate(invalid='ignore'):
        within = np.abs(terrain.height_m) < parameters.max_step_m + noise_m
    return np.asarray(within & known_heights(terrain, parameters))


def _quiet(terrain: Terrain, parameters: TerrainParameters) -> Mask:
    limit_m = parameters.max_ground_noise_share * parameters.max_step_m
    return np.asarray(terrain.noise_m < limit_m)


def _pixels_of_cells(terrain: Terrain, marked: Callable[[Layer], Mask]) -> Mask:
    """Pixels of the cells that are marked in any layer."""
    found = np.zeros(terrain.height_m.shape, np.bool_)
    for layer in terrain.layers:
        cells = marked(layer)
        if cells.any():
            layer.fill(found, layer.sampled(cells.astype(np.float32)) > 0.5)
    return found
