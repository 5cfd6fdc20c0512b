"""Ground that the rover cannot drive over: too steep, dropping away, or too rough."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.images.components import (
    components,
    marked,
    parts_with,
    rows_of_components,
    small_parts,
)
from rover_obstacle_detection.detection.terrain.cell_evidence import CellEvidence
from rover_obstacle_detection.detection.terrain.elevation_map import Grid, cell_means
from rover_obstacle_detection.detection.terrain.local_ground import smoothed
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.slope import (
    Hazard,
    Hollows,
    SteepCells,
    steep_cells,
)
from rover_obstacle_detection.detection.terrain.terrain import Layer, Terrain

Mask = NDArray[np.bool_]


def steep_ground(
    terrain: Terrain,
    cells: Sequence[CellEvidence],
    ground: GroundPlane,
    parameters: TerrainParameters,
) -> Hazard:
    """Find the pixels of ground that is measured to be steeper than the rover can climb.

    Parameters
    ----------
    terrain : Terrain
    cells : sequence of CellEvidence
        Of its maps.
    ground : GroundPlane
        With the vertical that slopes are measured against.
    parameters : TerrainParameters
    """
    p = parameters

    def steep(each: CellEvidence) -> SteepCells:
        found = steep_cells(each.rise, ground, p)
        if not found.found.any():
            return found
        # Smoothing takes the edges of a slope.
        margin_m = p.slope_margin_m + p.scales_of_rise_m[0]
        beside = _dilated(found.found, margin_m / each.layer.positions.cell_m)
        return found._replace(possible=found.possible | beside)

    found, possible, certain = _on_pixels(terrain, cells, steep, 3)
    return Hazard(parts_with(certain, found & quiet(terrain, p)), possible)


def large_slopes(steep: Mask, parameters: TerrainParameters) -> Mask:
    """Select the slopes that are no specks, and fill the narrow gaps in them.

    In the gaps nothing is matched, and they are too narrow to stand on.

    Parameters
    ----------
    steep : ndarray of bool, shape (height, width)
        Pixels of slopes, where they are measured.
    parameters : TerrainParameters
    """
    if not steep.any():
        return steep
    p = parameters
    large = steep & ~small_parts(steep, round(p.min_large_slope_share * steep.size))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (p.max_slope_gap_px | 1,) * 2)
    closed = cv2.morphologyEx(large.view(np.uint8), cv2.MORPH_CLOSE, kernel)
    return np.asarray(large | (closed > 0))


def dropping_ground(
    terrain: Terrain, cells: Sequence[CellEvidence], parameters: TerrainParameters
) -> Hazard:
    """Find the pixels of ground that lies deeper below its rim than the rover can step.

    Parameters
    ----------
    terrain : Terrain
    cells : sequence of CellEvidence
        Of its maps.
    parameters : TerrainParameters
    """
    p = parameters

    def dropped(each: CellEvidence) -> Hazard:
        depth_m, noise_m = each.hollows.depth_m, each.hollows.noise_m
        found = depth_m > p.max_step_m + p.drop_noises * noise_m
        least_m = min(p.min_hollow_m, p.max_step_m / 2)
        most_m = np.maximum(p.max_step_m - p.free_noises * noise_m, least_m)
        possible = depth_m > most_m
        certain = found & (noise_m < p.max_ground_noise_share * p.max_step_m)
        if certain.any():
            cell_m = each.layer.positions.cell_m
            possible |= _below_rim_nearby(certain, each.hollows, cell_m, p) > most_m
        return Hazard(np.asarray(found), np.asarray(possible))

    found, possible = _on_pixels(terrain, cells, dropped, 2)
    return Hazard(found & quiet(terrain, p), possible)


def _below_rim_nearby(
    found: Mask, hollows: Hollows, cell_m: float, parameters: TerrainParameters
) -> Grid:
    """Depth below the highest rim of a hollow found nearby.

    A hollow may go on where its rim is hidden or outside the view.
    """
    rim_m = np.where(found, hollows.level_m + hollows.depth_m, np.float32(-1e4))
    size = round(parameters.max_hollow_m / cell_m) | 1
    highest_m = cv2.dilate(rim_m, cv2.getStructuringElement(cv2.MORPH_RECT, (size, size)))
    return np.asarray(highest_m - hollows.level_m, np.float32)


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

    found = np.zeros_like(usable)
    for layer in terrain.layers:
        _fill(found, layer, rough(layer))
    return found & usable


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
    high &= quiet(terrain, parameters)
    if not high.any():
        return np.asarray(high)
    # What is small and high up stands on nothing: a false match.
    pixels, owner, count = components(high)
    rows = rows_of_components(pixels // high.shape[1], owner, count)
    scale = np.bincount(owner, weights=terrain.pixels_per_metre.ravel()[pixels])
    height_m = rows * np.bincount(owner) / np.maximum(scale, 1e-6)
    large = height_m > parameters.min_wall_share * parameters.min_wall_m
    return marked(high.shape, pixels[large[owner]])


def quiet(terrain: Terrain, parameters: TerrainParameters) -> Mask:
    """Mark where the height is known well enough to judge slopes and drops."""
    limit_m = parameters.max_ground_noise_share * parameters.max_step_m
    return np.asarray(terrain.noise_m < limit_m)


def _dilated(cells: Mask, radius: float) -> Mask:
    size = max(1, round(2 * radius)) | 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.dilate(cells.view(np.uint8), kernel) > 0)


def _on_pixels(
    terrain: Terrain,
    cells: Sequence[CellEvidence],
    judge: Callable[[CellEvidence], tuple[Mask, ...]],
    count: int,
) -> list[Mask]:
    """Pixels of the kinds of cells that each map has."""
    kinds = [np.zeros(terrain.height_m.shape, np.bool_) for _ in range(count)]
    for each in cells:
        for pixels, chosen in zip(kinds, judge(each), strict=True):
            _fill(pixels, each.layer, chosen)
    return kinds


def _fill(pixels: Mask, layer: Layer, cells: Mask) -> None:
    """Mark the pixels within a layer's span that lie in marked cells."""
    if cells.any():
        layer.fill(pixels, layer.sampled(cells.astype(np.float32)) > 0.5)
