"""Positions for the pixels of obstacles that have no 3D of their own."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.result.obstacles import NumberedObstacles

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Rows = NDArray[np.float32]
"""Positions and heights, shape (n, 4): x, y, z, height, metres."""

# Pixels around those without 3D within which a pixel with 3D is looked for first.
NEARBY_PX = 16
# Ground is looked for at every n-th row and column.
GROUND_STRIDE = 4


class Carrier:
    """Gives pixels of obstacles without 3D a position on their obstacle.

    Parameters
    ----------
    points : ndarray of float32, shape (height, width, 3)
        Left optical frame, metres; NaN where none.
    height_m : ndarray of float32, shape (height, width)
        Above the local ground; NaN where none.
    rays : tuple of two ndarray of float32
        ``x / z`` and ``y / z`` of each pixel, shapes that broadcast to (height, width).
    ground : GroundPlane
    is_ground : callable
        Returns the free pixels with 3D: ndarray of bool, shape (height, width).
    span_m : tuple of float
        Nearest and farthest depth along the optical axis that is judged.
    """

    def __init__(
        self,
        points: Image,
        height_m: Image,
        rays: tuple[Image, Image],
        ground: GroundPlane,
        is_ground: Callable[[], Mask],
        span_m: tuple[float, float],
    ) -> None:
        self._points = points
        self._height_m = height_m
        shape = height_m.shape
        self._x, self._y = (np.broadcast_to(each, shape) for each in rays)
        self._ground = ground
        self._normal = np.asarray(ground.normal, np.float32)
        self._is_ground = is_ground
        self._span_m = span_m

    def place(
        self, missing: Mask, own: Mask, body: Mask, numbered: NumberedObstacles
    ) -> tuple[Mask, Rows]:
        """Place the pixels of obstacles that have no 3D.

        Parameters
        ----------
        missing : ndarray of bool, shape (height, width)
            Pixels of obstacles to place.
        own : ndarray of bool, shape (height, width)
            Pixels of obstacles with 3D of their own.
        body : ndarray of bool, shape (height, width)
            Pixels to take the range from, where an obstacle has such pixels with 3D.
        numbered : NumberedObstacles

        Returns
        -------
        placed : ndarray of bool, shape (height, width)
            Those of the missing pixels that got a position.
        rows : ndarray of float32, shape (n, 4)
            Their x, y, z and height above the local ground, metres, row by row.

        Notes
        -----
        A pixel takes the range of the nearest pixel of the same obstacle that has 3D. An obstacle
        without any 3D stands upright where the ray through its foot meets the ground beside it. It
        gets no position if no ground was measured, or if that place is outside the range.
        """
        placed = np.zeros(missing.shape, np.bool_)
        indices, rows = [np.zeros(0, np.intp)], [np.zeros((0, 4), np.float32)]
        for number in np.flatnonzero(np.bincount(numbered.image[missing])):
            left, top, width, height = (int(each) for each in numbered.boxes[number - 1, :4])
            window = np.s_[top : top + height, left : left + width]
            same = numbered.image[window] == number
            wanted, source = missing[window] & same, own[window] & same
            if source.any():
                likely = source & body[window]
                source = likely if likely.any() else source
                found = self._beside(*_cut(window, wanted, source))
            elif self._ground.measured:
                found = self._upright(window, wanted)
            else:
                continue
            finite = np.isfinite(found).all(axis=1)
            row, column = (each[finite] for each in np.nonzero(wanted))
            placed[window][row, column] = True
            indices.append((top + row) * missing.shape[1] + left + column)
            rows.append(found[finite])
        order = np.argsort(np.concatenate(indices))
        return placed, np.concatenate(rows)[order]

    def _directions(self, window: tuple[slice, slice], where: Mask) -> Rows:
        """Rays of a window's marked pixels, shape (n, 3), with z = 1."""
        x, y = self._x[window][where], self._y[window][where]
        return np.stack((x, y, np.ones_like(x)), axis=1)

    def _beside(self, window: tuple[slice, slice], wanted: Mask, source: Mask) -> Rows:
        """Take the range of the nearest source pixel."""
        # The nearest source pixel is never surrounded by others.
        eroded = cv2.erode(source.astype(np.uint8), np.ones((3, 3), np.uint8))
        edge = source & ~eroded.astype(np.bool_)
        _, labels = cv2.distanceTransformWithLabels(
            (~edge).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
        )
        # Each source pixel has a label of its own.
        index = np.zeros(np.count_nonzero(edge) + 1, np.intp)
        index[labels[edge]] = np.flatnonzero(edge)
        nearest = np.unravel_index(index[labels[wanted]], edge.shape)
        from_points = self._points[window][nearest]
        rays = self._directions(window, wanted)
        stretch = np.linalg.norm(from_points, axis=1) / np.linalg.norm(rays, axis=1)
        points = rays * stretch[:, np.newaxis]
        height_m = self._height_m[window][nearest] + (points - from_points) @ self._normal
        return np.column_stack((points, height_m)).astype(np.float32)

    def _upright(self, window: tuple[slice, slice], wanted: Mask) -> Rows:
        """Stand an obstacle upright on the ground at its foot; NaN where that is impossible."""
        rays = self._directions(window, wanted)
        rows, columns = np.nonzero(wanted)
        lowest = np.flatnonzero(rows == rows[-1])
        foot = lowest[len(lowest) // 2]
        row, column = window[0].start + rows[foot], window[1].start + columns[foot]
        offset_m = self._ground_offset_m(row, column)
        descent = float(rays[foot] @ self._normal)
        nearest_m, farthest_m = self._span_m
        depth_m = offset_m / descent if descent < 0 else math.inf
        if not nearest_m <= depth_m <= farthest_m:
            return np.full((len(rays), 4), np.nan, np.float32)
        place = depth_m * rays[foot]
        up = self._ground.up_vector
        ahead = place - (place @ up) * up
        facing = rays @ ahead
        with np.errstate(divide='ignore', invalid='ignore'):
            points = rays * (place @ ahead / np.where(facing > 0, facing, np.nan))[:, np.newaxis]
        height_m = points @ self._normal - np.float32(offset_m)
        return np.column_stack((points, height_m)).astype(np.float32)

    def _ground_offset_m(self, row: int, column: int) -> float:
        """Offset along the normal of the measured ground nearest to a pixel."""
        rows, columns = self._ground_pixels
        if not rows.size:
            return -self._ground.height_m
        nearest = int(np.argmin((rows - row) ** 2 + (columns - column) ** 2))
        at = rows[nearest], columns[nearest]
        return float(self._points[at] @ self._normal - self._height_m[at])

    @cached_property
    def _ground_pixels(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        rows, columns = np.nonzero(self._is_ground()[::GROUND_STRIDE, ::GROUND_STRIDE])
        return GROUND_STRIDE * rows, GROUND_STRIDE * columns


def _cut(
    window: tuple[slice, slice], wanted: Mask, source: Mask
) -> tuple[tuple[slice, slice], Mask, Mask]:
    """Cut a window down to the wanted pixels and what is near them, if that has a source."""
    left, top, width, height = cv2.boundingRect(wanted.astype(np.uint8))
    first_row, first_column = max(0, top - NEARBY_PX), max(0, left - NEARBY_PX)
    part = np.s_[first_row : top + height + NEARBY_PX, first_column : left + width + NEARBY_PX]
    if not source[part].any():
        return window, wanted, source
    row, column = window[0].start + first_row, window[1].start + first_column
    height, width = wanted[part].shape
    window = np.s_[row : row + height, column : column + width]
    return window, wanted[part], source[part]
