"""What the hazard network sees of the ground: evidence for each cell of a map, on one scale."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.elevation_map import Grid, ground_axes
from rover_obstacle_detection.detection.terrain.gradient import Rise
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.slope import Hollows, level_heights, steepness
from rover_obstacle_detection.detection.terrain.terrain import Layer

FEATURES = (
    'seen',
    'pixels',
    'noise over the step',
    'height over the local ground over the step',
    'bare',
    'relief within the cell over the step',
    'difference to the left over the slope',
    'difference to the near side over the slope',
    'rise to the right over the slope',
    'rise ahead over the slope',
    'scale of the rise',
    'steepness over the slope',
    'noise of the rise over the slope',
    'depth below the rim over the step',
    'noise of the depth over the step',
    'brim',
    'step',
    'side of a cell',
    'distance',
)
"""Feature planes, in order. *Step* and *slope* are the rover's limits."""

FEATURES_VERSION = '1'
"""Version of their definition, constants included: a model is trained for one of them."""

TRAINED_STEPS_M, TRAINED_SLOPES_DEG = (0.05, 0.3), (12.0, 32.0)
"""Limits of the rovers that the network was trained for."""

# Part of the definition of the features.
_USUAL_STEP_M, _USUAL_SCALE_M, _USUAL_CELL_M = 0.1, 0.1, 0.04
_LEAST_NOISE_M, _NEAREST_M = 1e-3, 0.3
_LARGEST = 6.0


def cell_features(
    layer: Layer,
    rise: Rise,
    hollows: Hollows,
    brim: Grid,
    ground: GroundPlane,
    parameters: TerrainParameters,
) -> NDArray[np.float32]:
    """Bring what is measured of each cell to one scale.

    Heights are relative to the rover's step and slopes to the slope that it climbs.

    Parameters
    ----------
    layer : Layer
    rise : Rise
        Of the ground over the plane.
    hollows : Hollows
        Depth of each cell below its rim.
    brim : ndarray of float32, shape of the map
        Share of each cell's pixels that are the edge of a brim.
    ground : GroundPlane
        The plane, and the vertical.
    parameters : TerrainParameters

    Returns
    -------
    ndarray of float32, shape (features, rows, columns)
        In the order of `FEATURES`.
    """
    p, cell_m, seen = parameters, layer.positions.cell_m, layer.seen
    step_m, limit = p.max_step_m, max(math.tan(math.radians(p.max_slope_deg)), 1e-3)
    variance = layer.noise_m * layer.noise_m + np.float32(p.min_noise_m**2)
    level_m = level_heights(layer.mean_m, cell_m, ground)
    tilt_right, tilt_ahead = (float(axis @ np.asarray(ground.up)) for axis in ground_axes(ground))
    along_m = (np.arange(len(seen)) + layer.positions.first_row)[:, np.newaxis] * cell_m
    planes = (
        seen,
        np.log1p(layer.information * variance) / 3,
        np.log(np.maximum(layer.noise_m, _LEAST_NOISE_M) / step_m) * seen,
        (layer.mean_m - layer.ground_m) / step_m * seen,
        layer.is_bare,
        layer.relief_m / step_m,
        _difference(level_m, seen, axis=1) / (cell_m * limit),
        _difference(level_m, seen, axis=0) / (cell_m * limit),
        (rise.right + tilt_right) / limit,
        (rise.forward + tilt_ahead) / limit,
        np.log(rise.scale_m / _USUAL_SCALE_M),
        steepness(rise, ground) / limit,
        rise.noise / limit,
        hollows.depth_m / step_m,
        hollows.noise_m / step_m,
        brim,
        math.log(step_m / _USUAL_STEP_M),
        math.log(cell_m / _USUAL_CELL_M) / 2,
        np.log(np.maximum(along_m, _NEAREST_M)),
    )
    features = np.empty((len(FEATURES), *seen.shape), np.float32)
    for feature, plane in zip(features, planes, strict=True):
        feature[:] = plane
    return np.clip(features, -_LARGEST, _LARGEST, out=features)


def _difference(level_m: Grid, seen: NDArray[np.bool_], axis: int) -> Grid:
    """Difference of each cell to the one before it along an axis; 0 unless both are seen."""
    difference = np.diff(level_m, axis=axis, prepend=np.float32(0))
    before = np.roll(seen, 1, axis)
    np.moveaxis(before, axis, 0)[0] = False
    return np.where(seen & before, difference, 0).astype(np.float32)
