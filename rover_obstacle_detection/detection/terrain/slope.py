"""Ground that is too steep and ground that drops away, on the map."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.elevation_map import Grid, ground_axes
from rover_obstacle_detection.detection.terrain.gradient import Rise
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters


def steep_cells(
    rise: Rise, ground: GroundPlane, parameters: TerrainParameters
) -> NDArray[np.bool_]:
    """Find the cells that are steeper against the horizontal than the rover can climb.

    Parameters
    ----------
    rise : Rise
        Of the ground over the plane, at rover scale.
    ground : GroundPlane
        The plane, and the vertical.
    parameters : TerrainParameters

    Notes
    -----
    Smoothing removes a few degrees where a slope begins and ends. So connected cells that are
    almost too steep belong to the slope as well, if enough of the whole is too steep. Cells with
    too noisy a rise do not count.
    """
    right, forward = ground_axes(ground)
    up, normal = np.asarray(ground.up), np.asarray(ground.normal)
    # In the plane's axes the surface normal is (-rise.right, -rise.forward, 1).
    upward = (
        float(normal @ up) - float(right @ up) * rise.right - float(forward @ up) * rise.forward
    )
    length = np.sqrt(1 + rise.right * rise.right + rise.forward * rise.forward)
    known = rise.noise < math.tan(math.radians(parameters.max_rise_noise_deg))
    limit_deg = parameters.max_slope_deg
    steep = (upward < math.cos(math.radians(limit_deg)) * length) & known
    if not steep.any():
        return np.asarray(steep)
    nearly_deg = max(limit_deg - parameters.lost_slope_deg, 0)
    nearly = (upward < math.cos(math.radians(nearly_deg)) * length) & known
    count, labels = cv2.connectedComponents(nearly.astype(np.uint8), connectivity=8)
    whole = np.bincount(labels.ravel(), minlength=count)
    part = np.bincount(labels[steep], minlength=count)
    kept = part >= parameters.steep_share * whole
    kept[0] = False
    return np.asarray(steep | kept[labels])


def level_heights(relief_m: Grid, cell_m: float, ground: GroundPlane) -> Grid:
    """Convert heights over the plane to heights along the vertical, up to a constant.

    Over a plane that lies between level ground and a slope, the foot of the slope would look like
    a hollow.

    Parameters
    ----------
    relief_m : ndarray of float32, shape (rows, columns)
        Height of the ground over the plane, metres.
    cell_m : float
        Side of a cell, metres.
    ground : GroundPlane
        The plane, and the vertical.
    """
    up, (right, forward) = np.asarray(ground.up), ground_axes(ground)
    rows, columns = relief_m.shape
    across_m = np.arange(columns, dtype=np.float32) * np.float32(cell_m * float(right @ up))
    along_m = np.arange(rows, dtype=np.float32) * np.float32(cell_m * float(forward @ up))
    upright = np.float32(np.asarray(ground.normal) @ up)
    return np.asarray(relief_m * upright + across_m + along_m[:, np.newaxis], np.float32)


def dropped_cells(
    height_m: Grid,
    seen: NDArray[np.bool_],
    cell_m: float,
    max_drop_m: float | Grid,
    parameters: TerrainParameters,
) -> NDArray[np.bool_]:
    """Find the cells that lie deeper below their rim than the rover can step.

    Parameters
    ----------
    height_m : ndarray of float32, shape (rows, columns)
        Height of the ground along the vertical, metres, from any level.
    seen : ndarray of bool, shape (rows, columns)
        Measured cells: only those can be a rim.
    cell_m : float
        Side of a cell, metres.
    max_drop_m : float or ndarray of float32, shape (rows, columns)
    parameters : TerrainParameters

    Notes
    -----
    A grey-value closing minus the ground gives the depth to which a hollow would fill with water.
    Water would run out over unseen ground, so a hollow needs a rim all around. The closing runs on
    coarser cells.
    """
    reduction = max(1, round(parameters.max_hollow_m / (parameters.hollow_cells * cell_m)))
    rows, columns = height_m.shape
    small = max(1, columns // reduction), max(1, rows // reduction)
    share = cv2.resize(seen.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    total = cv2.resize(np.where(seen, height_m, 0), small, interpolation=cv2.INTER_AREA)
    abyss = np.float32(-1e4)
    level = np.where(share > 0, total / np.maximum(share, 1e-6), abyss).astype(np.float32)
    size = round(parameters.max_hollow_m / (reduction * cell_m)) | 1
    # Room for the kernel outside the map, where nothing is seen.
    wide = cv2.copyMakeBorder(level, *4 * (size,), cv2.BORDER_CONSTANT, value=float(abyss))
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (size, size))
    rim = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, kernel)[size:-size, size:-size]
    depth_m = cv2.resize(rim, (columns, rows), interpolation=cv2.INTER_NEAREST) - height_m
    return np.asarray((depth_m > max_drop_m) & seen)
