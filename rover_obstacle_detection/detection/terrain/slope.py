"""Ground that is too steep and ground that drops away, on the map."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.terrain.elevation_map import Grid, ground_axes
from rover_obstacle_detection.detection.terrain.gradient import Rise
from rover_obstacle_detection.detection.terrain.parameters import LEDGE_RUN, TerrainParameters

Mask = NDArray[np.bool_]


class Hazard(NamedTuple):
    """Where the ground is a hazard, and where it may be one.

    Parameters
    ----------
    found : ndarray of bool
        Cells or pixels of the hazard.
    possible : ndarray of bool, same shape
        Those where it cannot be ruled out.
    """

    found: Mask
    possible: Mask


class SteepCells(NamedTuple):
    """Cells of slopes.

    Parameters
    ----------
    found : ndarray of bool, shape of the map
        Cells that are measured to be too steep, and those that belong to them.
    possible : ndarray of bool, shape of the map
        Cells where a slope cannot be ruled out.
    certain : ndarray of bool, shape of the map
        Found cells of slopes that are steeper than noise could make them.
    """

    found: Mask
    possible: Mask
    certain: Mask


def steep_cells(rise: Rise, ground: GroundPlane, parameters: TerrainParameters) -> SteepCells:
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
    too noisy a rise do not count. Beyond both errors, smoothing and noise, a slope is ruled out.
    Where the rise is only known at a wide scale, a ledge is as flat as a gentle slope: there,
    ground is ruled out as a slope only if it is flatter than a ledge would look.
    """
    upward = _upward(rise, ground)
    known = rise.noise < math.tan(math.radians(parameters.max_rise_noise_deg))
    limit = math.radians(parameters.max_slope_deg)
    nearly = max(limit - math.radians(parameters.lost_slope_deg), 0)
    lost = min(limit - nearly, parameters.max_lost_share * limit)
    sure = np.minimum(limit - lost, _slope_of_a_ledge(rise.scale_m, parameters.max_step_m))
    sure -= parameters.free_noises * np.arctan(rise.noise)
    # What is not a number is not ruled out.
    possible = ~((upward >= np.cos(sure)) & (sure > 0))
    steep = (upward < math.cos(limit)) & known
    if not steep.any():
        return SteepCells(np.asarray(steep), np.asarray(possible), np.asarray(steep))
    almost = (upward < math.cos(nearly)) & known
    count, labels = cv2.connectedComponents(almost.astype(np.uint8), connectivity=8)
    whole = np.bincount(labels.ravel(), minlength=count)
    part = np.bincount(labels[steep], minlength=count)
    kept = part >= parameters.steep_share * whole
    kept[0] = False
    excess = np.asarray(np.arccos(upward[almost]) - limit, np.float32)
    windows_m2 = np.float32(4 * math.pi) * np.square(rise.scale_m[almost])
    samples = np.asarray(np.float32(rise.cell_m**2) / windows_m2, np.float32)
    certain = _beyond_noise(
        excess, np.arctan(rise.noise[almost]), samples, labels[almost], parameters
    )
    found = np.asarray(steep | kept[labels])
    return SteepCells(found, np.asarray(possible), found & certain[labels])


def steepness(rise: Rise, ground: GroundPlane) -> Grid:
    """Tangent of the slope against the horizontal."""
    upward = np.clip(_upward(rise, ground), np.float32(0.1), 1)
    return np.asarray(np.sqrt(1 / (upward * upward) - 1), np.float32)


def _upward(rise: Rise, ground: GroundPlane) -> Grid:
    """Cosine of the slope against the horizontal."""
    right, forward = ground_axes(ground)
    up, normal = np.asarray(ground.up), np.asarray(ground.normal)
    # In the plane's axes the surface normal is (-rise.right, -rise.forward, 1).
    upward = (
        float(normal @ up) - float(right @ up) * rise.right - float(forward @ up) * rise.forward
    )
    return np.asarray(upward / np.sqrt(1 + rise.right * rise.right + rise.forward * rise.forward))


def _beyond_noise(
    excess: Grid, noise: Grid, samples: Grid, part: NDArray[Any], parameters: TerrainParameters
) -> Mask:
    """Find the slopes that are steeper, as a whole or in several cells, than noise makes them.

    Parameters
    ----------
    excess, noise : ndarray of float32, shape (n,)
        Angle of each cell over the limit, and its standard deviation, radians.
    samples : ndarray of float32, shape (n,)
        Independent samples of the noise that a cell has: a Gaussian window takes as much ground
        as ``4 pi`` squares of its scale.
    part : ndarray of int, shape (n,)
        Number of the slope that each cell belongs to.
    parameters : TerrainParameters

    Returns
    -------
    ndarray of bool, shape (slopes,)
    """
    noises = parameters.certain_slope_noises
    cells = np.maximum(np.bincount(part), 1)
    mean, mean_noise, total = (
        np.bincount(part, weights=values)
        for values in (excess / cells[part], noise / cells[part], samples)
    )
    whole = mean > noises * mean_noise / np.sqrt(np.maximum(total, 1))
    clear = np.bincount(part[excess > noises * noise], minlength=cells.size)
    return np.asarray(whole | (clear > parameters.certain_slope_share * cells))


def _slope_of_a_ledge(scale_m: Grid, max_step_m: float) -> Grid:
    """Slope of a ledge as high as the rover's step, as each scale shows it, radians."""
    return np.asarray(np.arctan(np.float32(max_step_m / LEDGE_RUN) / scale_m), np.float32)


@dataclass(frozen=True, eq=False)
class Hollows:
    """Depth below the rim around, at rover scale.

    Parameters
    ----------
    level_m : ndarray of float32, shape of the map
        Height of the ground along the vertical, from any level, metres.
    depth_m, noise_m : ndarray of float32, shape of the map
        Depth and its standard deviation, metres.
    """

    level_m: Grid
    depth_m: Grid
    noise_m: Grid


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


def hollow_depth(height_m: Grid, seen: Mask, cell_m: float, parameters: TerrainParameters) -> Grid:
    """Measure how deep each cell lies below the rim around it.

    Parameters
    ----------
    height_m : ndarray of float32, shape (rows, columns)
        Height of the ground along the vertical, metres, from any level.
    seen : ndarray of bool, shape (rows, columns)
        Measured cells: only those can be a rim.
    cell_m : float
        Side of a cell, metres.
    parameters : TerrainParameters

    Returns
    -------
    ndarray of float32, shape (rows, columns)
        Metres; 0 in cells that are not seen.

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
    return np.where(seen, depth_m, np.float32(0))
