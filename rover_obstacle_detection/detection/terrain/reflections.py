"""Points below the ground that can only be reflections or false matches."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.noise import height_noise_m
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.brim_parameters import ReflectionParameters
from rover_obstacle_detection.detection.terrain.elevation_map import plane_coordinates
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters

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
    p, height_m = parameters.reflections, np.float32(stereo.ground.height_m)
    found = np.zeros(stereo.disparity.shape, np.bool_)
    # Hardly a pixel may be low enough, so the others are left out before anything is computed.
    least = np.float32(0.9999 * (1 + parameters.max_step_m / stereo.ground.height_m))
    low = stereo.disparity * least < stereo.expected
    low &= stereo.disparity > stereo.frame.camera.disparity_at(parameters.max_range_m)
    where = np.nonzero(low)
    points = _Points.at(stereo, where, parameters)
    deep = points.height_m < -points.limit_m
    if not deep.any():
        return found
    # A quarter of the pixels shows where ground is.
    level = _LevelGround.mapped(_Points.at(stereo, np.s_[::2, ::2], parameters), p)
    points, where = points.only(deep), (where[0][deep], where[1][deep])
    passed = np.zeros(len(points.height_m), np.bool_)
    for part in p.parts:
        # The line meets the plane at the share 1 / share of its length.
        reach = np.float32(part) + np.float32(1 - part) / points.share
        # The far wall of a trench stands below the ground behind it.
        short = (1 - reach) * points.along_m > np.float32(p.margin_m)
        looked = np.flatnonzero(short & ~passed)
        ahead, reach = points.only(looked), reach[looked]
        line_m = height_m * (1 - reach) + reach * ahead.height_m
        ground_m = level.height_m(ahead.across_m * reach, ahead.along_m * reach)
        passed[looked] = ground_m > line_m + ahead.limit_m
    found[where] = passed
    return found


@dataclass(frozen=True, eq=False)
class _Points:
    """Places over the ground plane, all of one shape.

    Parameters
    ----------
    in_range : ndarray of bool
        What is not has no meaning.
    share : ndarray of float32
        Disparity of the plane over that of the point.
    height_m, limit_m, across_m, along_m : ndarray of float32
        Over the plane, what is level, and along it.
    """

    in_range: Mask
    share: Image
    height_m: Image
    limit_m: Image
    across_m: Image
    along_m: Image

    @classmethod
    def at(cls, stereo: Stereo, where: Any, parameters: TerrainParameters) -> _Points:
        """Return the points of the indexed pixels."""
        camera, ground, disparity = stereo.frame.camera, stereo.ground, stereo.disparity[where]
        in_range = disparity > camera.disparity_at(parameters.max_range_m)
        share = stereo.expected[where] / np.maximum(disparity, np.float32(1e-6))
        share[~in_range] = 1
        height_m = np.float32(ground.height_m) * (1 - share)
        descent_m = np.maximum(np.float32(ground.height_m) - height_m, np.float32(0))
        noise_m = height_noise_m(disparity, descent_m, stereo.noise_px[where])
        x, y = (np.broadcast_to(each, camera.shape)[where] for each in camera.rays())
        return cls(
            in_range,
            share,
            height_m,
            parameters.max_step_m + parameters.reflections.noises * noise_m,
            *plane_coordinates(disparity, camera, ground, (x, y)),
        )

    def only(self, which: NDArray[Any]) -> _Points:
        """Return some of the points."""
        return _Points(*(getattr(self, each.name)[which] for each in fields(self)))


@dataclass(frozen=True, eq=False)
class _LevelGround:
    """Mean height of the ground near the plane, in square cells; minus infinity where none."""

    mean_m: Image
    cell_m: float

    @classmethod
    def mapped(cls, points: _Points, parameters: ReflectionParameters) -> _LevelGround:
        side = parameters.cells
        level = points.only(points.in_range & (np.abs(points.height_m) < points.limit_m))
        cell, inside = _cells(level.across_m, level.along_m, parameters.cell_m, side)
        count = np.bincount(cell[inside], minlength=side * side)
        total = np.bincount(cell[inside], weights=level.height_m[inside], minlength=side * side)
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
