"""Ground that is too steep, and ground that drops away, on the map seen from above."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.elevation_map import Grid, ground_axes
from rover_obstacle_detection.detection.terrain.gradient import Rise

LOST_SLOPE_DEG = 2.5
STEEP_SHARE = 0.4
# A rise with so much noise may be anything.
UNTOLD_DEG = 20.0


def steep_cells(rise: Rise, ground: GroundPlane, max_slope_deg: float) -> NDArray[np.bool_]:
    """Find the cells whose slope against the horizontal is more than the rover climbs.

    Parameters
    ----------
    rise : Rise
        Of the ground over the plane, at rover scale.
    ground : GroundPlane
        The plane, and the vertical against which slope counts.
    max_slope_deg : float

    Notes
    -----
    Smoothing takes a few degrees off a slope where it begins and ends: what is connected and
    hardly less steep belongs to it, if a good part of the whole is steep enough. A rise that may
    be anything is none.
    """
    right, forward = ground_axes(ground)
    up, normal = np.asarray(ground.up), np.asarray(ground.normal)
    # The surface normal in the plane's axes is (-rise.right, -rise.forward, 1).
    upward = (
        float(normal @ up) - float(right @ up) * rise.right - float(forward @ up) * rise.forward
    )
    length = np.sqrt(1 + rise.right * rise.right + rise.forward * rise.forward)
    known = rise.noise < math.tan(math.radians(UNTOLD_DEG))
    steep = (upward < math.cos(math.radians(max_slope_deg)) * length) & known
    if not steep.any():
        return np.asarray(steep)
    less = math.radians(max(max_slope_deg - LOST_SLOPE_DEG, 0))
    nearly = (upward < math.cos(less) * length) & known
    count, labels = cv2.connectedComponents(nearly.astype(np.uint8), connectivity=8)
    whole = np.bincount(labels.ravel(), minlength=count)
    part = np.bincount(labels[steep], minlength=count)
    kept = part >= STEEP_SHARE * whole
    kept[0] = False
    return np.asarray(steep | kept[labels])


def level_heights(relief_m: Grid, cell_m: float, ground: GroundPlane) -> Grid:
    """Turn heights over the plane into heights along the vertical, but for a constant.

    Over a plane that lies between level ground and a slope, the foot of the slope is a hollow.

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
    surroundings_m: float,
    max_drop_m: float | Grid,
) -> NDArray[np.bool_]:
    """Find the cells that lie deeper below their surroundings than the rover can step.

    Parameters
    ----------
    height_m : ndarray of float32, shape (rows, columns)
        Height of the ground along the vertical, over any level, metres.
    seen : ndarray of bool, shape (rows, columns)
        Cells that were measured: only those can be a brim.
    cell_m : float
        Side of a cell, metres.
    surroundings_m : float
        Hollows narrower than this are drops; wider ones are terrain, metres.
    max_drop_m : float or ndarray of float32, shape (rows, columns)

    Notes
    -----
    Grey-value closing minus the ground: the depth to which a hollow would fill up. Water would
    run out over ground that nobody has seen, so a hollow needs a brim all around. The closing is
    made on cells of about a twentieth of ``surroundings_m``.
    """
    reduction = max(1, round(surroundings_m / (20 * cell_m)))
    rows, columns = height_m.shape
    small = max(1, columns // reduction), max(1, rows // reduction)
    share = cv2.resize(seen.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    total = cv2.resize(np.where(seen, height_m, 0), small, interpolation=cv2.INTER_AREA)
    abyss = np.float32(-1e4)
    level = np.where(share > 0, total / np.maximum(share, 1e-6), abyss).astype(np.float32)
    size = round(surroundings_m / (reduction * cell_m)) | 1
    # Room for the kernel to stand outside the map, where nothing is seen.
    wide = cv2.copyMakeBorder(level, *4 * (size,), cv2.BORDER_CONSTANT, value=float(abyss))
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (size, size))
    brim = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, kernel)[size:-size, size:-size]
    depth_m = cv2.resize(brim, (columns, rows), interpolation=cv2.INTER_NEAREST) - height_m
    return np.asarray((depth_m > max_drop_m) & seen)
