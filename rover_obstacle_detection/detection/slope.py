"""Ground that is too steep, and ground that drops away, on the map seen from above."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.elevation_map import Grid, ground_axes
from rover_obstacle_detection.detection.gravity import GroundPlane


def steep_cells(
    relief_m: Grid, cell_m: float, ground: GroundPlane, max_slope_deg: float
) -> NDArray[np.bool_]:
    """Find the cells whose slope against the horizontal is more than the rover climbs.

    Parameters
    ----------
    relief_m : ndarray of float32, shape (rows, columns)
        Height of the ground over the plane, smooth at rover scale, metres.
    cell_m : float
        Side of a cell, metres.
    ground : GroundPlane
        The plane, and the vertical against which slope counts.
    max_slope_deg : float
    """
    right, forward = ground_axes(ground)
    up, normal = np.asarray(ground.up), np.asarray(ground.normal)
    rise_right = cv2.Sobel(relief_m, cv2.CV_32F, 1, 0, ksize=3, scale=1 / (8 * cell_m))
    rise_forward = cv2.Sobel(relief_m, cv2.CV_32F, 0, 1, ksize=3, scale=1 / (8 * cell_m))
    # The surface normal in the plane's axes is (-rise_right, -rise_forward, 1).
    upward = (
        float(normal @ up) - float(right @ up) * rise_right - float(forward @ up) * rise_forward
    )
    length = np.sqrt(1 + rise_right * rise_right + rise_forward * rise_forward)
    return np.asarray(upward < math.cos(math.radians(max_slope_deg)) * length)


def dropped_cells(
    relief_m: Grid, cell_m: float, surroundings_m: float, max_drop_m: float
) -> NDArray[np.bool_]:
    """Find the cells that lie deeper below their surroundings than the rover can step.

    Parameters
    ----------
    relief_m : ndarray of float32, shape (rows, columns)
        Height of the ground over the plane, metres.
    cell_m : float
        Side of a cell, metres.
    surroundings_m : float
        Hollows narrower than this are drops; wider ones are terrain, metres.
    max_drop_m : float

    Notes
    -----
    Grey-value closing minus the ground: the depth to which a hollow would fill up. It is taken
    on a coarser grid, whose cells are a twentieth of ``surroundings_m``.
    """
    reduction = max(1, round(surroundings_m / (20 * cell_m)))
    rows, columns = relief_m.shape
    small = cv2.resize(
        relief_m, (max(1, columns // reduction), max(1, rows // reduction)),
        interpolation=cv2.INTER_AREA,
    )  # fmt: skip
    size = round(surroundings_m / (reduction * cell_m)) | 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    brim = cv2.morphologyEx(small, cv2.MORPH_CLOSE, kernel, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(
        cv2.resize(brim, (columns, rows), interpolation=cv2.INTER_LINEAR) - relief_m > max_drop_m
    )
