"""The survey: height of every pixel above the ground around it, near and far."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.noise import height_noise_m
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.elevation_map import (
    CellSums,
    map_positions,
    plane_coordinates,
)
from rover_obstacle_detection.detection.terrain.local_ground import local_ground
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.terrain import Image, Layer, Terrain
from rover_obstacle_detection.detection.terrain.viewpoint import Viewpoint, lever_m

Span = tuple[float, float]
"""Side of a cell and farthest distance of a layer, metres."""


def survey(stereo: Stereo, parameters: TerrainParameters) -> Terrain:
    """Measure the height of every pixel above the ground around it.

    On the ground, the distance between image rows and the noise of distance both grow with the
    square of the distance. One cell size cannot serve near and far rocks, so each layer's cells
    are twice as wide as those of the layer before.

    Parameters
    ----------
    stereo : Stereo
    parameters : TerrainParameters
    """
    spans = layer_spans(stereo.frame.camera, stereo.ground.height_m, parameters)
    return survey_layers(stereo, list(spans), parameters)


def survey_layers(stereo: Stereo, spans: list[Span], parameters: TerrainParameters) -> Terrain:
    """Measure with one layer for each of the given spans, nearest first."""
    disparity, camera_height_m = stereo.disparity, stereo.ground.height_m
    points = _points_over_plane(stereo, parameters)
    height_m = np.full_like(disparity, np.nan)
    camera_m = np.full_like(disparity, camera_height_m)
    descent_m = points.descent_m.copy()
    layers = []
    nearest_m = -math.inf
    for cell_m, farthest_m in spans:
        layer = _map_layer(points, cell_m, (nearest_m, farthest_m), camera_height_m, parameters)
        nearest_m = farthest_m
        if layer is None:
            continue
        above_m = points.over_plane_m[layer.rows][layer.own_rows] - layer.sampled(layer.ground_m)
        over_m = layer.sampled(layer.camera_m)
        layer.fill(height_m, above_m)
        layer.fill(camera_m, over_m)
        layer.fill(descent_m, over_m - above_m)
        layers.append(layer)
    lever = lever_m(descent_m, camera_height_m, parameters.min_lever_share)
    return Terrain(
        height_m,
        height_noise_m(disparity, lever, stereo.noise_px),
        camera_m,
        disparity / np.float32(stereo.frame.camera.baseline_m),
        tuple(layers),
    )


def layer_spans(
    camera: StereoCamera, camera_height_m: float, parameters: TerrainParameters
) -> Iterator[Span]:
    """Yield side of a cell and farthest distance of each layer, nearest first.

    Parameters
    ----------
    camera : StereoCamera
    camera_height_m : float
        Of the left camera over the ground, metres.
    parameters : TerrainParameters
    """
    cell_m = parameters.cell_per_step * parameters.resolved_m
    for number in range(parameters.max_layers):
        farthest_m = math.sqrt(camera.fy * camera_height_m * cell_m * parameters.rows_per_cell)
        farthest_m = min(farthest_m, parameters.max_cells * cell_m)
        if farthest_m >= parameters.max_range_m or number == parameters.max_layers - 1:
            yield max(cell_m, parameters.max_range_m / parameters.max_cells), math.inf
            return
        yield cell_m, farthest_m
        cell_m *= 2


def rows_with(pixels: NDArray[np.bool_]) -> slice:
    """Image rows from the first marked pixel to the last."""
    rows = np.flatnonzero(pixels.any(axis=1))
    return slice(int(rows[0]), int(rows[-1]) + 1) if rows.size else slice(0, 0)


@dataclass(frozen=True, eq=False)
class _Points:
    """Every pixel's place over the plane, its height noise, and its weight on the map."""

    in_range: NDArray[np.bool_]
    over_plane_m: Image
    across_m: Image
    along_m: Image
    descent_m: Image
    noise_m: Image
    trust: Image
    information: Image


def _points_over_plane(stereo: Stereo, parameters: TerrainParameters) -> _Points:
    camera, ground, disparity = stereo.frame.camera, stereo.ground, stereo.disparity
    in_range = disparity > camera.disparity_at(parameters.max_range_m)
    over_plane_m = np.float32(ground.height_m) * (disparity - stereo.expected)
    # Where it is not used, the divisor does not matter.
    over_plane_m /= np.maximum(disparity, np.float32(1e-6))
    over_plane_m[~in_range] = 0
    # A point moves along its ray, which descends from the camera to the point.
    descent_m = np.float32(ground.height_m) - over_plane_m
    lever = lever_m(descent_m, ground.height_m, parameters.min_lever_share)
    noise_m = height_noise_m(disparity, lever, stereo.noise_px)
    across_m, along_m = plane_coordinates(disparity, camera, ground)
    rise = math.tan(math.radians(max(parameters.max_slope_deg, parameters.repose_deg)))
    # False matches in the sky would otherwise become ground nearby.
    ground_like = in_range & (over_plane_m <= rise * along_m + parameters.max_step_m)
    relief, variance = np.float32(parameters.cell_relief_m**2), noise_m * noise_m
    trust = relief / (relief + variance)
    trust *= ground_like
    variance += np.float32(parameters.min_noise_m**2)
    return _Points(
        in_range,
        over_plane_m,
        across_m,
        along_m,
        descent_m,
        noise_m,
        trust,
        np.reciprocal(variance, out=variance),
    )


def _map_layer(
    points: _Points,
    cell_m: float,
    span_m: tuple[float, float],
    camera_height_m: float,
    parameters: TerrainParameters,
) -> Layer | None:
    """Map the ground between two distances; None where no pixel lies there."""
    nearest_m, farthest_m = span_m
    if not (points.along_m > nearest_m).any():
        return None
    overlap, overlap_m = parameters.overlap_factor, parameters.overlap_m
    usable = points.in_range & (points.along_m <= farthest_m * overlap + overlap_m)
    usable &= points.along_m >= nearest_m / overlap - overlap_m
    # Seen along the ground, some pixels lie far to the side.
    usable &= np.abs(points.across_m) < parameters.max_cells / 2 * cell_m
    rows = rows_with(usable)
    usable, along_m = usable[rows], points.along_m[rows]
    pixels = usable & (along_m > nearest_m) & (along_m <= farthest_m)
    if not pixels.any():
        return None
    positions = map_positions(points.across_m[rows], along_m, usable, cell_m)
    trust = points.trust[rows]
    sums = CellSums(usable & (trust > 0), positions)
    mean_m, weight = sums.means(points.over_plane_m[rows], trust)
    square_m2, _ = sums.means(np.square(points.over_plane_m[rows]), trust)
    noise_m, information = sums.means(points.noise_m[rows], points.information[rows])
    relief_m2 = square_m2 - mean_m * mean_m - noise_m * noise_m
    lever = lever_m(
        np.float32(camera_height_m) - mean_m, camera_height_m, parameters.min_lever_share
    )
    viewpoint = Viewpoint(
        camera_height_m,
        -positions.first_column,
        -positions.first_row,
        noise_m / lever,
        parameters.min_lever_share,
    )
    ground = local_ground(mean_m, weight, cell_m, viewpoint, parameters)
    return Layer(
        rows=rows,
        positions=positions,
        pixels=pixels,
        seen=weight > 0,
        is_bare=ground.is_bare,
        mean_m=mean_m,
        noise_m=noise_m,
        relief_m=np.sqrt(np.maximum(relief_m2, 0)),
        information=information,
        ground_m=ground.height_m,
        camera_m=viewpoint.above(ground.trend),
    )
