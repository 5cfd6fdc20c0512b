"""What is left of the rectification: by how many rows the right image is off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera


@dataclass(frozen=True)
class RowAlignment:
    """Where in the right image the row of a left pixel is: ``v + offset + turn (u - cx)``.

    Parameters
    ----------
    offset_px : float
        At the principal point, pixels of the full image.
    turn : float
        Turn of the right image about its axis, radians.
    """

    offset_px: float = 0.0
    turn: float = 0.0

    def rows(self, camera: StereoCamera, columns: NDArray[np.float32]) -> NDArray[np.float32]:
        """Row in the right image of each pixel of given columns, shape (height, columns)."""
        shift = self.offset_px + self.turn * (columns - np.float32(camera.cx))
        rows = np.arange(camera.height, dtype=np.float32)
        return np.asarray(rows[:, np.newaxis] + shift[np.newaxis], np.float32)

    def added_disparity(self, camera: StereoCamera) -> NDArray[np.float32]:
        """Disparity that the turn alone makes in each row, pixels, shape (height, 1)."""
        rows = np.arange(camera.height, dtype=np.float32) - np.float32(camera.cy)
        return np.asarray(self.turn * rows[:, np.newaxis], np.float32)

    def most_px(self, camera: StereoCamera) -> float:
        """Rows by which the side of the full image that is off the most is off, pixels."""
        sides = np.array([0, camera.width - 1]) - camera.cx
        return float(np.abs(self.offset_px + self.turn * sides).max())

    def reduced(self, reduction: float) -> RowAlignment:
        """Return the same of images a ``reduction``-th as wide and as high."""
        return replace(self, offset_px=self.offset_px / reduction)


STRAIGHT = RowAlignment()
