"""Rows by which the right image of a rectified pair is off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera


@dataclass(frozen=True)
class RowAlignment:
    """Left pixel (u, v) lies in row ``v + offset + turn (u - cx)`` of the right image.

    Parameters
    ----------
    offset_px : float
        At the principal point, pixels.
    turn : float
        Rotation of the right image about its optical axis, radians.
    """

    offset_px: float = 0.0
    turn: float = 0.0

    def places(
        self,
        disparity: NDArray[np.float32],
        camera: StereoCamera,
        first_row: int = 0,
        first_column: int = 0,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Column and row in the right image of each pixel of the left one, or of a part of it.

        Parameters
        ----------
        disparity : ndarray of float32, shape (height, width)
            Of the part, pixels, without the camera's offset.
        camera : StereoCamera
        first_row, first_column : int
            Where the part begins.
        """
        last_row, last_column = np.add(disparity.shape, (first_row, first_column))
        rows = np.arange(first_row, last_row, dtype=np.float32)
        columns = np.arange(first_column, last_column, dtype=np.float32)
        added = np.float32(self.turn) * (rows - np.float32(camera.cy))
        right_columns = columns - disparity
        right_columns -= (added + np.float32(camera.disparity_offset))[:, np.newaxis]
        shift = self.offset_px + self.turn * (columns - np.float32(camera.cx))
        return right_columns, rows[:, np.newaxis] + shift.astype(np.float32)

    def rows(self, camera: StereoCamera, columns: NDArray[np.float32]) -> NDArray[np.float32]:
        """Row in the right image of each pixel of the given columns, shape (height, columns)."""
        shift = self.offset_px + self.turn * (columns - np.float32(camera.cx))
        rows = np.arange(camera.height, dtype=np.float32)
        return np.asarray(rows[:, np.newaxis] + shift[np.newaxis], np.float32)

    def added_disparity(self, camera: StereoCamera) -> NDArray[np.float32]:
        """Disparity that the turn adds to each row, pixels, shape (height, 1)."""
        rows = np.arange(camera.height, dtype=np.float32) - np.float32(camera.cy)
        return np.asarray(self.turn * rows[:, np.newaxis], np.float32)

    def most_px(self, camera: StereoCamera) -> float:
        """Row shift at the side of the image where it is largest, pixels."""
        sides = np.array([0, camera.width - 1]) - camera.cx
        return float(np.abs(self.offset_px + self.turn * sides).max())

    def mirrored(self) -> RowAlignment:
        """Return the same for images with their rows in reverse order."""
        return RowAlignment(-self.offset_px, -self.turn)

    def reduced(self, reduction: float) -> RowAlignment:
        """Return the same for images reduced by a factor."""
        return replace(self, offset_px=self.offset_px / reduction)


STRAIGHT = RowAlignment()
