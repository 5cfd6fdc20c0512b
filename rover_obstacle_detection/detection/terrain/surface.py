"""Heights over the ground plane in the image, and the places that pixels show."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.noise import height_noise_m
from rover_obstacle_detection.detection.images.components import runs
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.elevation_map import ground_axes
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters

Image = NDArray[np.float32]
Rows = NDArray[Any]


class Nearest(NamedTuple):
    """Row and height of the nearest match in one direction, each of shape (height, width).

    The last row in that direction and NaN where there is none.
    """

    rows: NDArray[np.int32]
    height_m: Image


class Surface:
    """Heights over the ground plane.

    Everything else is computed where it is needed, as hardly a pixel is near a brim.

    Attributes
    ----------
    height_m : ndarray of float32, shape (height, width)
        Over the ground plane, metres; NaN where there is no match.
    """

    def __init__(self, stereo: Stereo, parameters: TerrainParameters) -> None:
        self._stereo, self._parameters = stereo, parameters
        self._camera, self._ground = stereo.frame.camera, stereo.ground
        disparity = stereo.disparity
        missing = disparity <= self._camera.disparity_at(parameters.max_range_m)
        self.height_m = np.float32(self._ground.height_m) * (disparity - stereo.expected)
        self.height_m /= np.maximum(disparity, np.float32(1e-6))
        self.height_m[missing] = np.nan

    def nearest(self) -> tuple[Nearest, Nearest]:
        """Find the nearest match at or below, and at or above, each pixel in its column."""
        height, width = self.height_m.shape
        # Most pixels are their own nearest match; gaps are looked up column by column.
        missing = np.ascontiguousarray(np.isnan(self.height_m).T)
        first, last = runs(missing)
        column, row = np.divmod(np.flatnonzero(missing), height)
        gap = row * width + column

        def filled(rows_of_gaps: Rows) -> Nearest:
            row_of_pixel = np.repeat(rows_of_gaps, last - first + 1)
            rows = np.repeat(np.arange(height, dtype=np.int32), width).reshape(height, width)
            rows.ravel()[gap] = row_of_pixel
            height_m = self.height_m.copy()
            height_m.ravel()[gap] = self.height_m[row_of_pixel, column]
            return Nearest(rows, height_m)

        below = filled(np.minimum(last % height + 1, height - 1))
        return below, filled(np.maximum(first % height - 1, 0))

    def points(self, rows: Rows, columns: Rows) -> Points:
        """Return the points at the given pixels."""
        camera, ground = self._camera, self._ground
        disparity = np.maximum(self._stereo.disparity[rows, columns], np.float32(1e-3))
        height_m = self.height_m[rows, columns]
        x_over_z, y_over_z = camera.rays()
        _, forward = ground_axes(ground)
        rays = forward[0] * x_over_z.ravel()[columns] + forward[1] * y_over_z.ravel()[rows]
        along_m = camera.fx * camera.baseline_m / disparity * (rays + forward[2])
        descent_m = np.maximum(np.float32(ground.height_m) - height_m, 0)
        noise_px = self._stereo.noise_px[rows, columns]
        return Points(
            height_m,
            along_m.astype(np.float32),
            descent_m * noise_px / disparity,
            descent_m,
            np.asarray(disparity / np.float32(camera.baseline_m), np.float32),
        )

    def rows_per_metre(self, points: Points) -> Image:
        """Image rows to a metre of level ground at the distance of each point."""
        squares = points.along_m**2 + self._ground.height_m**2
        return np.asarray(self._camera.fy * self._ground.height_m / squares, np.float32)

    def limit_m(self, where: Any) -> Image:
        """How far below a brim each of the indexed pixels is lower than a step, metres."""
        stereo, p = self._stereo, self._parameters
        camera_m = np.float32(self._ground.height_m)
        descent_m = np.maximum(camera_m - self.height_m[where], np.float32(0))
        noise_m = height_noise_m(stereo.disparity[where], descent_m, stereo.noise_px[where])
        return np.float32(p.max_step_m) + np.float32(p.brims.noises) * noise_m


class Points(NamedTuple):
    """Places over the ground plane, each of shape (n,)."""

    height_m: Image
    along_m: Image
    noise_m: Image
    descent_m: Image
    columns_per_metre: Image

    def among(self, chosen: NDArray[np.bool_]) -> Points:
        """Return some of the points."""
        return Points(*(each[chosen] for each in self))

    @property
    def sight(self) -> Image:
        """Slope of the sight line to each point."""
        return np.asarray(self.descent_m / np.maximum(self.along_m, np.float32(1e-3)))
