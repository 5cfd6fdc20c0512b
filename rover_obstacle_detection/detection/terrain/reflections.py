"""Points below the ground that can only be reflections or false matches."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.noise import height_noise_m
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.elevation_map import plane_coordinates
from rover_obstacle_detection.detection.terrain.parameters import (
    ReflectionParameters,
    TerrainParameters,
)

Mask = NDArray[np.bool_]
Image = NDArray[np.float32]


def without_reflections(stereo: Stereo, parameters: TerrainParameters) -> Stereo:
    """Remove the matches that are seen through the ground.

    Parameters
    ----------
    stereo : Stereo
    parameters : TerrainParameters

    Returns
    -------
    Stereo
        Without matches where the sight line passes below ground that is measured.
    """
    through = seen_through_ground(stereo, parameters)
    if not through.any():
        return stereo
    return replace(stereo, disparity=np.where(through, np.float32(0), stereo.disparity))


def seen_through_ground(stereo: Stereo, parameters: TerrainParameters) -> Mask:
    """Find the points whose sight line passes below ground that is measured.

    A puddle or the rover's own bonnet mirrors what stands behind it. The mirrored points lie far
    below the ground, and their sight lines run below it from the mirror on.

    Parameters
    ----------
    stereo : Stereo
    parameters : TerrainParameters

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    Each sight line is followed from where it meets the ground plane to its point. In a true
    hollow, the ground it passes is the hollow's own and no higher than the line.
    """
    p = parameters.reflections
    camera, ground, disparity = stereo.frame.camera, stereo.ground, stereo.disparity
    found = np.zeros(disparity.shape, np.bool_)
    in_range = disparity > camera.disparity_at(parameters.max_range_m)
    # Relative to the plane's disparity: below the plane, a point has less.
    share = np.ones_like(disparity)
    np.divide(stereo.expected, disparity, out=share, where=in_range)
    height_m = np.float32(ground.height_m) * (1 - share)
    descent_m = np.maximum(np.float32(ground.height_m) - height_m, np.float32(0))
    noise_m = height_noise_m(disparity, descent_m, stereo.noise_px)
    limit_m = parameters.max_step_m + p.noises * noise_m
    low = in_range & (height_m < -limit_m)
    if not low.any():
        return found
    across_m, along_m = plane_coordinates(disparity, camera, ground)
    is_level = in_range & (np.abs(height_m) < limit_m)
    # A quarter of the pixels shows where ground is.
    every = np.s_[::2, ::2]
    level = _LevelGround.mapped(
        across_m[every], along_m[every], height_m[every], is_level[every], p
    )
    across_m, along_m, height_m, limit_m, share = (
        each[low] for each in (across_m, along_m, height_m, limit_m, share)
    )
    passed = np.zeros(height_m.shape, np.bool_)
    for part in p.parts:
        # The line meets the plane at the share 1 / share of its length.
        reach = np.float32(part) + np.float32(1 - part) / share
        line_m = np.float32(ground.height_m) * (1 - reach) + reach * height_m
        # The far wall of a trench stands below the ground behind it.
        short = (1 - reach) * along_m > np.float32(p.margin_m)
        passed |= short & (level.height_m(across_m * reach, along_m * reach) > line_m + limit_m)
    found[low] = passed
    return found


@dataclass(frozen=True, eq=False)
class _LevelGround:
    """Mean height of the ground near the plane, in square cells; minus infinity where none."""

    mean_m: Image
    cell_m: float

    @classmethod
    def mapped(
        cls,
        across_m: Image,
        along_m: Image,
        height_m: Image,
        level: Mask,
        parameters: ReflectionParameters,
    ) -> _LevelGround:
        side = parameters.cells
        cell, inside = _cells(across_m[level], along_m[level], parameters.cell_m, side)
        count = np.bincount(cell[inside], minlength=side * side)
        total = np.bincount(cell[inside], weights=height_m[level][inside], minlength=side * side)
        seen = count >= parameters.min_points
        mean_m = np.where(seen, total / np.maximum(count, 1), -np.inf)
        return cls(mean_m.astype(np.float32), parameters.cell_m)

    def height_m(self, across_m: Image, along_m: Image) -> Image:
        side = int(np.sqrt(self.mean_m.size))
        cell, inside = _cells(across_m, along_m, self.cell_m, side)
        return np.where(inside, self.mean_m[np.where(inside, cell, 0)], np.float32(-np.inf))


def _cells(
    across_m: Image, along_m: Image, cell_m: float, side: int
) -> tuple[NDArray[np.intp], Mask]:
    """Cell of each point on a square map ahead of the camera, and whether it lies on it."""
    column = np.floor(across_m / np.float32(cell_m)).astype(np.intp) + side // 2
    row = np.floor(along_m / np.float32(cell_m)).astype(np.intp)
    inside = (column >= 0) & (column < side) & (row >= 0) & (row < side)
    return row * side + column, inside
