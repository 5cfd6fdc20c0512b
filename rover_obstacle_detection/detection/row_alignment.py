"""What is left of the rectification: how many rows the right image is off."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.camera import StereoCamera

_ITERATIONS = 5
_MOST_PX = 3.0
_MIN_PIXELS = 500
_WINDOW = 7
_SMOOTHING_PX = 0.8
_OUTLIER = 3.0


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


def estimate_row_alignment(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    reduction: float,
) -> RowAlignment:
    """Measure the rows by which a pair is off, over the whole image at once.

    Parameters
    ----------
    left, right : ndarray of uint8, shape (height, width)
        Of the disparity's size.
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    camera : StereoCamera
        Of the disparity's size.
    reduction : float
        Pixels of the full image in one of these.

    Returns
    -------
    RowAlignment
        In pixels of the full image; none where too little is matched.

    Notes
    -----
    Gauss-Newton on the grey difference after warping by the disparity (Lucas and Kanade 1981),
    with two unknowns for the image. Disparity is itself wrong by a fraction of a pixel, and
    slanting texture would take that for a shift of rows: each window's own error of disparity is
    eliminated first.
    """
    matched = disparity > 0
    if np.count_nonzero(matched) < _MIN_PIXELS:
        return RowAlignment()
    columns = np.arange(camera.width, dtype=np.float32)
    source_columns = columns[np.newaxis] - disparity - np.float32(camera.disparity_offset)
    across = np.broadcast_to((columns - np.float32(camera.cx)) / camera.width, disparity.shape)
    # What a reduced image has of finer texture than its pixels would look like a shift.
    first, second = (
        np.asarray(cv2.GaussianBlur(eye, (0, 0), _SMOOTHING_PX), np.float32)
        for eye in (left, right)
    )
    offset, turn = 0.0, 0.0
    for _ in range(_ITERATIONS):
        rows = RowAlignment(offset, turn).rows(camera, columns)
        warped = cv2.remap(
            second,
            source_columns,
            rows,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        pull, weight = _row_pull(first, np.asarray(warped, np.float32), matched)
        design = np.stack((np.ones_like(weight), across[matched])).astype(np.float64)
        # A ridge of a few pixels' weight holds an image without texture still.
        normal_matrix = (design * weight) @ design.T + np.diag((1.0, 10.0))
        step = np.linalg.solve(normal_matrix, design @ pull)
        offset, turn = offset + float(step[0]), turn + float(step[1]) / camera.width
    if max(abs(offset), abs(turn) * camera.width / 2) * reduction > _MOST_PX:
        return RowAlignment()
    return RowAlignment(offset * reduction, turn)


def _row_pull(
    first: NDArray[np.float32], warped: NDArray[np.float32], matched: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Right side and weight of each matched window's equation for its shift of rows."""
    difference = first - warped
    difference -= cv2.blur(difference, (9, 9))
    spread = 1.4826 * float(np.median(np.abs(difference[matched]))) + 1e-3
    inlier = (matched & (np.abs(difference) < _OUTLIER * spread)).astype(np.float32)
    along = cv2.Scharr(warped, cv2.CV_32F, 1, 0, scale=1 / 32) * inlier
    down = cv2.Scharr(warped, cv2.CV_32F, 0, 1, scale=1 / 32) * inlier
    difference *= inlier

    def mean(image: cv2.typing.MatLike) -> NDArray[np.float32]:
        return np.asarray(cv2.blur(image, (_WINDOW, _WINDOW)), np.float32)[matched]

    # Without texture along the row there is no error of disparity to eliminate.
    share = mean(along * down) / (mean(along * along) + np.float32(0.01 * spread**2))
    pull = mean(down * difference) - share * mean(along * difference)
    weight = mean(down * down) - share * mean(along * down)
    return np.asarray(pull, np.float32), np.asarray(np.maximum(weight, 0), np.float32)
