"""What is measured of the terrain: heights by pixel, and the maps they come from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.terrain.elevation_map import (
    Grid,
    MapPositions,
    cell_means,
    sample_map,
)

Image = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Layer:
    """A map of the ground for one span of distances.

    Parameters
    ----------
    rows : slice
        Image rows that it covers.
    positions : MapPositions
        Of the mapped pixels in those rows, some of them beyond its span.
    pixels : ndarray of bool, shape (rows, width)
        Pixels of those rows within its span.
    seen : ndarray of bool, shape of the map
        Cells with pixels.
    is_bare : ndarray of bool, shape of the map
        Seen cells with nothing on them: see `LocalGround`.
    mean_m : ndarray of float32, shape of the map
        Mean height of each cell's pixels over the plane, metres.
    noise_m : ndarray of float32, shape of the map
        Standard deviation of the height of one of its pixels, metres; 0 in empty cells.
    relief_m : ndarray of float32, shape of the map
        Standard deviation of the heights within each cell, beyond their noise, metres.
    information : ndarray of float32, shape of the map
        Sum of 1 / variance over the pixels of each cell, 1 / m^2.
    ground_m : ndarray of float32, shape of the map
        Height of the ground over the plane, metres.
    camera_m : ndarray of float32, shape of the map
        Height of the left camera over the plane through the ground around each cell, metres.
    """

    rows: slice
    positions: MapPositions
    pixels: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    is_bare: NDArray[np.bool_]
    mean_m: Grid
    noise_m: Grid
    relief_m: Grid
    information: Grid
    ground_m: Grid
    camera_m: Grid

    @cached_property
    def own_rows(self) -> slice:
        """Those of `rows`, counted from the first, that have pixels within its span."""
        rows = np.flatnonzero(self.pixels.any(axis=1))
        return slice(int(rows[0]), int(rows[-1]) + 1)

    def sampled(self, grid: Grid) -> Image:
        """Sample a map at each pixel of the own rows."""
        return sample_map(grid, self.positions.within(self.own_rows))

    def fill(self, image: NDArray[Any], values: NDArray[Any]) -> None:
        """Copy the values of the own rows to the pixels of an image that are within the span."""
        np.copyto(image[self.rows][self.own_rows], values, where=self.pixels[self.own_rows])

    def without(self, excluded: NDArray[np.bool_]) -> Layer:
        """Return the layer without the cells that show mostly excluded pixels.

        Parameters
        ----------
        excluded : ndarray of bool, shape (height, width) of the image
        """
        excluded = excluded[self.rows]
        if not excluded.any():
            return self
        weight = self.positions.inside.astype(np.float32)
        share, _ = cell_means(excluded.astype(np.float32), weight, self.positions)
        return replace(self, seen=self.seen & (share < 0.5))


@dataclass(frozen=True, eq=False)
class Terrain:
    """What is measured at each pixel.

    Parameters
    ----------
    height_m : ndarray of float32, shape (height, width)
        Above the local ground, metres; NaN where there is no 3D within range.
    noise_m : ndarray of float32, shape (height, width)
        Its standard deviation, metres; infinite where there is no match.
    camera_m : ndarray of float32, shape (height, width)
        Height of the left camera over the plane through the ground around each pixel, metres;
        negative where that ground is seen from below.
    pixels_per_metre : ndarray of float32, shape (height, width)
        Image scale at the pixel's distance; 0 where there is no match.
    layers : tuple of Layer
        Nearest first.
    """

    height_m: Image
    noise_m: Image
    camera_m: Image
    pixels_per_metre: Image
    layers: tuple[Layer, ...]

    @cached_property
    def measured(self) -> NDArray[np.bool_]:
        """Pixels with a height."""
        return np.isfinite(self.height_m)

    @cached_property
    def nearest_measured(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
        """The nearest measured pixel of each pixel that is not.

        Returns
        -------
        pixels : ndarray of int, shape (n,)
            Flat indices of the unmeasured pixels; none if nothing is measured.
        sources : ndarray of int, shape (n,)
            Flat indices of their nearest measured pixels.
        distance_px : ndarray of float32, shape (n,)
            Between both.
        """
        missing, places = np.flatnonzero(~self.measured), np.flatnonzero(self.measured)
        if not missing.size or not places.size:
            nothing = np.zeros(0, np.intp)
            return nothing, nothing, np.zeros(0, np.float32)
        distance_px, labels = cv2.distanceTransformWithLabels(
            (~self.measured).view(np.uint8),
            cv2.DIST_L2,
            cv2.DIST_MASK_5,
            labelType=cv2.DIST_LABEL_PIXEL,
        )
        # OpenCV labels the measured pixels from 1, row by row.
        sources = places[labels.ravel()[missing] - 1]
        return missing, sources, np.asarray(distance_px.ravel()[missing], np.float32)

    def within(self, window: tuple[slice, slice]) -> Terrain:
        """Return a window of the image, without the layers."""
        return Terrain(
            self.height_m[window],
            self.noise_m[window],
            self.camera_m[window],
            self.pixels_per_metre[window],
            (),
        )
