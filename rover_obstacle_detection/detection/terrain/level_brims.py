"""Brims by the vertical: steps in ground that, as a whole, looks like a slope."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.brim_parameters import BrimParameters
from rover_obstacle_detection.detection.terrain.brims import Brims
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters

Mask = NDArray[np.bool_]
Vector = tuple[float, float, float]
FindBrims = Callable[[Stereo, TerrainParameters], Brims]


@dataclass(frozen=True, eq=False)
class AllBrims:
    """Brims over the ground plane, and over level planes that differ from it.

    Parameters
    ----------
    parts : tuple of Brims
    """

    parts: tuple[Brims, ...]

    def not_on(self, obstacles: Mask, parameters: BrimParameters) -> AllBrims:
        """Return the brims that are no rims of the given obstacles: see `Brims.not_on`."""
        return AllBrims(tuple(each.not_on(obstacles, parameters) for each in self.parts))

    def doubted(self, sparse: Mask, parameters: BrimParameters) -> AllBrims:
        """Return the same brims, not sure before sparse ground: see `Brims.doubted`."""
        return AllBrims(tuple(each.doubted(sparse, parameters) for each in self.parts))

    def edge(self, parameters: BrimParameters) -> Mask:
        """Mark the last of the ground before each sure brim: see `Brims.edge`."""
        return np.asarray(np.logical_or.reduce([each.edge(parameters) for each in self.parts]))

    def near(self, parameters: BrimParameters) -> Mask:
        """Mark the ground near brims that is never free: see `Brims.near`."""
        return np.asarray(np.logical_or.reduce([each.near(parameters) for each in self.parts]))

    def beyond(self) -> Mask:
        """Mark the pixels behind a deep brim that lie lower than the rover can step."""
        return np.asarray(np.logical_or.reduce([each.beyond() for each in self.parts]))


def brims_by_vertical(
    brims: AllBrims,
    verticals: Sequence[Vector],
    stereo: Stereo,
    find: FindBrims,
    parameters: TerrainParameters,
) -> tuple[AllBrims, Vector]:
    """Add the brims over level planes, and choose the vertical that shows most of them.

    The ground plane runs along the middle of a flight of stairs. Over it, each step falls by less
    than it does over a level plane. Over a level plane, slopes are no brims, since nothing is
    hidden behind them.

    Parameters
    ----------
    brims : AllBrims
        Over the ground plane.
    verticals : sequence of tuple of float
        Unit vectors in the left optical frame.
    stereo : Stereo
    find : callable
        Finds the brims over a plane.
    parameters : TerrainParameters

    Returns
    -------
    brims : AllBrims
    vertical : tuple of float
        That with most brims; if several have as many, the nearest to the normal of the ground
        plane, as the plane lies on the nearest ground.
    """
    normal, over_plane = np.asarray(stereo.ground.normal), brims.parts[0]
    least = math.cos(math.radians(parameters.brims.min_tilt_deg))
    judged = []
    for up in verticals:
        found, upright = over_plane, float(normal @ np.asarray(up))
        if upright < least:
            found = find(over_level_plane(stereo, up), parameters)
            brims = AllBrims((*brims.parts, found))
        judged.append(((int(np.count_nonzero(found.sure)), upright), up))
    return brims, max(judged, key=itemgetter(0))[1]


def over_level_plane(stereo: Stereo, up: Vector) -> Stereo:
    """Return the same matches over a level plane, as high below the camera as the ground plane.

    Parameters
    ----------
    stereo : Stereo
    up : tuple of float
        Unit vector in the left optical frame.
    """
    ground, camera = stereo.ground, stereo.frame.camera
    upright = float(np.asarray(ground.normal) @ np.asarray(up))
    level = replace(ground, normal=up, up=up, height_m=ground.height_m / upright)
    expected = DisparityPlane.from_ground(level, camera).disparity(camera)
    return replace(stereo, ground=level, expected=expected)
