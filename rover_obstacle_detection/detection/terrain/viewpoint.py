"""How steeply the camera looks down on the ground, and what that does to height noise.

Distance noise moves a point along its ray. Over the plane through all the ground this changes its
height as steeply as the ray descends; over sloping ground, as steeply as the ray descends towards
that ground. So a bank that faces the camera has more height noise than the plane suggests, and one
that falls away has less. All heights are along the normal of the plane through all the ground.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.terrain.local_regression import LocalPlanes

Grid = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Where the left camera is, relative to a map, and how well it measures distance there.

    Parameters
    ----------
    height_m : float
        Height of the camera over the map's plane, metres.
    column, row : float
        Its cell; mostly outside the map.
    distance_noise : ndarray of float32, shape of the map
        Standard deviation of the distance of one pixel, relative to the distance.
    min_lever_share : float
        See `lever_m`.
    """

    height_m: float
    column: float
    row: float
    distance_noise: Grid
    min_lever_share: float

    def above(self, ground: LocalPlanes) -> Grid:
        """Height of the camera over the plane around each cell, metres; negative if below it."""
        rows, columns = ground.height.shape
        down = np.arange(rows, dtype=np.float32)[:, np.newaxis] - np.float32(self.row)
        across = np.arange(columns, dtype=np.float32) - np.float32(self.column)
        above_m = ground.rise_along_rows * down
        above_m += ground.rise_along_columns * across
        above_m -= ground.height
        above_m += np.float32(self.height_m)
        return above_m

    def noise_m(self, ground: LocalPlanes) -> Grid:
        """Height noise of one pixel over the plane around each cell, metres."""
        return self.distance_noise * lever_m(
            self.above(ground), self.height_m, self.min_lever_share
        )


def lever_m(
    descent_m: NDArray[np.float32], camera_height_m: float, min_share: float
) -> NDArray[np.float32]:
    """Height change per relative change of distance, metres.

    Parameters
    ----------
    descent_m : ndarray of float32
        How far the ray to a point descends from the camera, relative to the ground where it ends;
        negative where that ground is seen from below.
    camera_height_m : float
        Height of the camera over the plane through all the ground, metres.
    min_share : float
        Least lever, as a share of that height.

    Returns
    -------
    ndarray of float32
        Metres of height for the whole distance, positive.
    """
    return np.maximum(np.abs(descent_m), np.float32(min_share * camera_height_m))
