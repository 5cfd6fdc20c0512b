"""What ground that slopes does to the noise of heights over it: how steeply it is looked down on.

Over the plane through all the ground a point moves with its distance as steeply as its ray comes
down; over the ground around it as steeply as the ray comes down on that. A bank that faces the
eye has more noise than the plane says, one that falls away less.

All heights are along the normal of the plane through all the ground, as everywhere on the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.terrain.local_regression import LocalPlanes

Grid = NDArray[np.float32]

# Looked at along the ground itself a height would have no noise: no ground is that smooth.
LEAST_SHARE = 0.3


@dataclass(frozen=True, eq=False)
class Sight:
    """Where the eye is, seen from a map, and how well it knows distances there.

    Parameters
    ----------
    eye_m : float
        Height of the eye over the map's plane, metres.
    column, row : float
        Where it is, cells; mostly outside of the map.
    share : ndarray of float32, shape of the map
        Noise of the distance over the distance, of one pixel.
    """

    eye_m: float
    column: float
    row: float
    share: Grid

    def over(self, ground: LocalPlanes) -> Grid:
        """Height of the eye over the plane around each cell, metres; below zero if under it."""
        rows, columns = ground.height.shape
        down = np.arange(rows, dtype=np.float32)[:, np.newaxis] - np.float32(self.row)
        across = np.arange(columns, dtype=np.float32) - np.float32(self.column)
        eye_m = ground.rise_along_rows * down
        eye_m += ground.rise_along_columns * across
        eye_m -= ground.height
        eye_m += np.float32(self.eye_m)
        return eye_m

    def noise_m(self, ground: LocalPlanes) -> Grid:
        """Noise of the height of one pixel over the plane around each cell, metres."""
        return self.share * lever_m(self.over(ground), self.eye_m)


def lever_m(below_eye_m: NDArray[np.float32], eye_m: float) -> NDArray[np.float32]:
    """Tell by how much a height changes with the distance, for the noise of one.

    Parameters
    ----------
    below_eye_m : ndarray of float32
        How far the ray to a point comes down from the eye, against the ground where it ends;
        below zero where that ground is seen from below.
    eye_m : float
        Height of the eye over the plane through all the ground, metres.

    Returns
    -------
    ndarray of float32
        Metres of height for the whole distance: positive, and at least `LEAST_SHARE` of the eye's.
    """
    return np.maximum(np.abs(below_eye_m), np.float32(LEAST_SHARE * eye_m))
