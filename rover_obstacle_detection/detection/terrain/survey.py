"""The terrain in view: height of every pixel over the ground around it, near and far."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.noise import height_noise_m
from rover_obstacle_detection.detection.terrain.elevation_map import (
    Grid,
    MapPositions,
    cell_means,
    map_positions,
    plane_coordinates,
    sample_map,
)
from rover_obstacle_detection.detection.terrain.local_ground import local_ground
from rover_obstacle_detection.detection.terrain.viewpoint import Sight, lever_m

Image = NDArray[np.float32]

# Scales of the terrain, in metres: what a wheel feels, what a rock is, what the ground does.
CELL_PER_STEP = 0.4
MAX_LAYERS = 5
MAX_CELLS = 1000
OPENING_M = 0.7
TREND_M = 0.4
SMOOTHING_M = 0.08
WITHIN_CELL_M = 0.03
LEAST_NOISE_M = 0.005
GROUND_SHARE = 0.5
# Loose ground slides where it is steeper.
REPOSE_DEG = 35.0

# A layer ends where two image rows lie a cell and a half apart, and sees a little beyond.
_ROWS_PER_CELL = 2.0
_OVERLAP = 1.25
_OVERLAP_M = 1.0


@dataclass(frozen=True, eq=False)
class Layer:
    """A map of the ground for one span of distances, its cells as coarse as the view is there.

    Parameters
    ----------
    rows : slice
        Rows of the image that it needs.
    positions : MapPositions
        Of the pixels in those rows that made it, some beyond its span.
    mean_m : ndarray of float32, shape of the map
        Mean height of each cell's pixels over the plane, metres.
    information : ndarray of float32, shape of the map
        What is known of a cell's height: sum over its pixels of 1 / variance, per square metre.
    noise_m : ndarray of float32, shape of the map
        Standard deviation of the height over the plane of one of its pixels, metres; 0 in empty
        cells.
    is_ground : ndarray of bool, shape of the map
        Seen cells that show the ground, and nothing that stands on it.
    ground_m : ndarray of float32, shape of the map
        Height of the ground over the plane, metres.
    seen : ndarray of bool, shape of the map
    eye_m : ndarray of float32, shape of the map
        Height of the eye over the plane that the ground around each cell lies in, metres.
    pixels : ndarray of bool, shape (rows, width)
        Pixels of those rows within its span.
    """

    rows: slice
    positions: MapPositions
    mean_m: Grid
    information: Grid
    noise_m: Grid
    is_ground: NDArray[np.bool_]
    ground_m: Grid
    seen: NDArray[np.bool_]
    eye_m: Grid
    pixels: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Terrain:
    """What was measured of each pixel.

    Parameters
    ----------
    height_m : ndarray of float32, shape (height, width)
        Above the local ground, metres; NaN where there is no 3D within range.
    noise_m : ndarray of float32, shape (height, width)
        Its standard deviation, metres; infinite where there is no match.
    eye_m : ndarray of float32, shape (height, width)
        Height of the eye over the plane that the ground around each pixel lies in, metres; below
        zero where that ground is seen from below.
    pixels_per_metre : ndarray of float32, shape (height, width)
        Of the image, at the pixel's distance; 0 where there is no match.
    layers : tuple of Layer
        Nearest first.
    """

    height_m: Image
    noise_m: Image
    eye_m: Image
    pixels_per_metre: Image
    layers: tuple[Layer, ...]

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Pixels with a height."""
        return np.isfinite(self.height_m)

    def within(self, window: tuple[slice, slice]) -> Terrain:
        """Give the same of a window of the image, without the layers."""
        return Terrain(
            self.height_m[window],
            self.noise_m[window],
            self.eye_m[window],
            self.pixels_per_metre[window],
            (),
        )


def survey(
    disparity: Image,
    noise_px: Image,
    expected: Image,
    camera: StereoCamera,
    ground: GroundPlane,
    config: DetectorConfig,
    *,
    layered: bool = True,
) -> Terrain:
    """Measure the height of every pixel above the ground around it.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    noise_px : ndarray of float32, shape (height, width)
        Standard deviation of the disparity, pixels.
    expected : ndarray of float32, shape (height, width)
        Disparity of the ground plane.
    camera : StereoCamera
    ground : GroundPlane
    config : DetectorConfig
    layered : bool
        Whether cells grow with the distance; else one map of the finest serves all.

    Notes
    -----
    On the ground the distance between image rows and the noise of distance both grow with its
    square, so one cell size cannot serve a near and a far rock: each layer's cells are twice as
    wide as those of the one before.
    """
    points = _points(disparity, noise_px, expected, camera, ground, config)
    height_m = np.full_like(disparity, np.nan)
    eye_m = np.full_like(disparity, ground.height_m)
    below_eye_m = points.below_eye_m.copy()
    layers = []
    nearest_m = -math.inf
    spans = list(layer_spans(camera, ground.height_m, config))
    for cell_m, farthest_m in spans if layered else [(spans[0][0], math.inf)]:
        layer = _map_layer(points, cell_m, (nearest_m, farthest_m), ground.height_m, config)
        nearest_m = farthest_m
        if layer is None:
            continue
        above_m = points.over_plane_m[layer.rows] - sample_map(layer.ground_m, layer.positions)
        np.copyto(height_m[layer.rows], above_m, where=layer.pixels)
        over_m = sample_map(layer.eye_m, layer.positions)
        np.copyto(eye_m[layer.rows], over_m, where=layer.pixels)
        np.copyto(below_eye_m[layer.rows], over_m - above_m, where=layer.pixels)
        layers.append(layer)
    return Terrain(
        height_m,
        height_noise_m(disparity, lever_m(below_eye_m, ground.height_m), noise_px),
        eye_m,
        disparity / np.float32(camera.baseline_m),
        tuple(layers),
    )


@dataclass(frozen=True, eq=False)
class _Points:
    """The points in range, by pixel: where over the plane they are, and how far to be trusted."""

    in_range: NDArray[np.bool_]
    over_plane_m: Image
    across_m: Image
    along_m: Image
    below_eye_m: Image
    noise_m: Image
    trust: Image
    information: Image


def _points(
    disparity: Image,
    noise_px: Image,
    expected: Image,
    camera: StereoCamera,
    ground: GroundPlane,
    config: DetectorConfig,
) -> _Points:
    """Bring every pixel over the plane."""
    in_range = disparity > camera.disparity_at(config.max_range)
    over_plane_m = np.zeros_like(disparity)
    np.divide(
        np.float32(ground.height_m) * (disparity - expected),
        disparity,
        out=over_plane_m,
        where=in_range,
    )
    # A point moves along its ray, which comes down from the eye to where the point is.
    below_eye_m = np.float32(ground.height_m) - over_plane_m
    noise_m = height_noise_m(disparity, lever_m(below_eye_m, ground.height_m), noise_px)
    across_m, along_m = plane_coordinates(disparity, camera, ground)
    rise = math.tan(math.radians(max(config.max_slope, REPOSE_DEG)))
    # Ground lies no steeper than it can: false matches in the sky would make some nearby.
    ground_like = in_range & (over_plane_m <= rise * along_m + config.max_step)
    relief = np.float32(WITHIN_CELL_M**2)
    trust = np.where(ground_like, relief / (relief + noise_m * noise_m), 0).astype(np.float32)
    variance = noise_m * noise_m + np.float32(LEAST_NOISE_M**2)
    information = np.reciprocal(variance).astype(np.float32)
    return _Points(
        in_range, over_plane_m, across_m, along_m, below_eye_m, noise_m, trust, information
    )


def _map_layer(
    points: _Points,
    cell_m: float,
    span_m: tuple[float, float],
    eye_m: float,
    config: DetectorConfig,
) -> Layer | None:
    """Map the ground between two distances; None where no pixel lies there."""
    nearest_m, farthest_m = span_m
    usable = points.in_range & (points.along_m <= farthest_m * _OVERLAP + _OVERLAP_M)
    usable &= points.along_m >= nearest_m / _OVERLAP - _OVERLAP_M
    rows = rows_with(usable)
    usable, along_m = usable[rows], points.along_m[rows]
    pixels = usable & (along_m > nearest_m) & (along_m <= farthest_m)
    if not pixels.any():
        return None
    positions = map_positions(points.across_m[rows], along_m, usable, cell_m)
    trust = points.trust[rows] * usable
    mean_m, weight = cell_means(points.over_plane_m[rows], trust, positions)
    cell_noise_m, information = cell_means(
        points.noise_m[rows], points.information[rows] * (trust > 0), positions
    )
    sight = Sight(
        eye_m,
        -positions.first_column,
        -positions.first_row,
        cell_noise_m / lever_m(np.float32(eye_m) - mean_m, eye_m),
    )
    ground = local_ground(
        mean_m,
        weight,
        cell_m,
        opening_m=max(OPENING_M, 3 * cell_m),
        trend_m=max(TREND_M, 2.5 * cell_m),
        smoothing_m=max(SMOOTHING_M, 1.2 * cell_m),
        tolerance_m=GROUND_SHARE * config.max_step,
        sight=sight,
    )
    return Layer(
        rows,
        positions,
        mean_m,
        information,
        cell_noise_m,
        ground.trust > 0,
        ground.height_m,
        weight > 0,
        sight.over(ground.trend),
        pixels,
    )


def rows_with(pixels: NDArray[np.bool_]) -> slice:
    """Give the rows of the image from the first such pixel to the last."""
    rows = np.flatnonzero(pixels.any(axis=1))
    return slice(int(rows[0]), int(rows[-1]) + 1) if rows.size else slice(0, 0)


def layer_spans(
    camera: StereoCamera, height_m: float, config: DetectorConfig
) -> Iterator[tuple[float, float]]:
    """Give side of a cell and farthest distance of each layer, metres, nearest first.

    Parameters
    ----------
    camera : StereoCamera
    height_m : float
        Of the left eye over the ground.
    config : DetectorConfig
    """
    cell_m = CELL_PER_STEP * config.max_step
    for number in range(MAX_LAYERS):
        farthest_m = math.sqrt(camera.fy * height_m * cell_m * _ROWS_PER_CELL)
        if farthest_m >= config.max_range or number == MAX_LAYERS - 1:
            yield max(cell_m, config.max_range / MAX_CELLS), math.inf
            return
        yield cell_m, farthest_m
        cell_m *= 2
