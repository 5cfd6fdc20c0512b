"""The rectified stereo camera: from calibration to depth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.errors import CameraError


class RegionOfInterest(Protocol):
    """The fields of ``sensor_msgs/RegionOfInterest`` that are used."""

    x_offset: int
    y_offset: int
    width: int
    height: int


@dataclass(frozen=True)
class StereoCamera:
    """A rectified stereo camera: same focal lengths and rows, the right camera to the right.

    Pixel centres lie at integers, so an ideal principal point is ``(width - 1) / 2``.

    Parameters
    ----------
    width, height : int
        Size of both images, pixels.
    fx, fy : float
        Focal lengths of both cameras, pixels.
    cx, cy : float
        Principal point of the left camera, pixels.
    baseline_m : float
        Distance of the right optical centre from the left one along x.
    cx_right : float, optional
        Column of the right camera's principal point. By default, that of the left camera.

    Raises
    ------
    CameraError
        If a number is not finite, or a size, focal length or the baseline is not positive.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    baseline_m: float
    cx_right: float | None = None

    def __post_init__(self) -> None:
        if self.cx_right is None:
            object.__setattr__(self, 'cx_right', self.cx)
        for name in ('width', 'height', 'fx', 'fy', 'baseline_m'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                msg = f'{name} is {value}: expected a positive number'
                if name == 'baseline_m':
                    msg += ' (it is -P_right[3] / P_right[0]; are left and right swapped?)'
                raise CameraError(msg)
        for name in ('cx', 'cy', 'cx_right'):
            if not math.isfinite(getattr(self, name)):
                msg = f'{name} is {getattr(self, name)}: expected a finite number'
                raise CameraError(msg)

    @classmethod
    def from_camera_info(cls, left: object, right: object) -> StereoCamera:
        """Read the calibration from two ``sensor_msgs/CameraInfo``-like objects.

        Parameters
        ----------
        left, right : object
            Message of rclpy or rosbags, or any object with ``width``, ``height`` and ``p`` (or
            ``P``). ``binning_x``, ``binning_y`` and ``roi`` are optional. They are applied as in
            ``image_geometry``: first the offset is subtracted, then the binning divides.

        Raises
        ------
        CameraError
            If a projection matrix is zero or not finite, or left and right contradict each other.
            The message names the field.
        """
        p_left = _projection(left, 'left')
        p_right = _projection(right, 'right')
        size_left, offset_left, binning = _window(left, 'left')
        size_right, offset_right, binning_right = _window(right, 'right')
        if size_left != size_right or binning != binning_right:
            msg = (
                f'left camera_info is {size_left[0]} x {size_left[1]} with binning {binning}, '
                f'right is {size_right[0]} x {size_right[1]} with binning {binning_right}: '
                'expected the same'
            )
            raise CameraError(msg)
        if offset_left[1] != offset_right[1]:
            msg = (
                f'roi.y_offset is {offset_left[1]} on the left and {offset_right[1]} on the '
                'right: expected the same rows of a rectified pair'
            )
            raise CameraError(msg)
        _check_rectified(p_left, p_right)
        return cls(
            width=size_left[0],
            height=size_left[1],
            fx=p_left[0] / binning[0],
            fy=p_left[5] / binning[1],
            cx=(p_left[2] - offset_left[0]) / binning[0],
            cy=(p_left[6] - offset_left[1]) / binning[1],
            baseline_m=-p_right[3] / p_right[0],
            cx_right=(p_right[2] - offset_right[0]) / binning[0],
        )

    @property
    def disparity_offset(self) -> float:
        """Disparity of a point at infinity, pixels: ``cx - cx_right``."""
        assert self.cx_right is not None
        return self.cx - self.cx_right

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of an image array: ``(height, width)``."""
        return self.height, self.width

    def depth_m(self, disparity: float) -> float:
        """Depth along the optical axis of a disparity without the camera's offset."""
        return self.fx * self.baseline_m / disparity

    def disparity_at(self, depth_m: float) -> float:
        """Disparity, without the camera's offset, of a depth along the optical axis."""
        return self.fx * self.baseline_m / depth_m

    def resized(self, width: int, height: int) -> StereoCamera:
        """Return the camera of images resampled to another size, not cropped."""
        scale_x, scale_y = width / self.width, height / self.height
        assert self.cx_right is not None
        return StereoCamera(
            width=width,
            height=height,
            fx=self.fx * scale_x,
            fy=self.fy * scale_y,
            cx=(self.cx + 0.5) * scale_x - 0.5,
            cy=(self.cy + 0.5) * scale_y - 0.5,
            baseline_m=self.baseline_m,
            cx_right=(self.cx_right + 0.5) * scale_x - 0.5,
        )

    def rays(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Compute the direction of each column and row.

        Returns
        -------
        x_over_z : ndarray of float32, shape (1, width)
        y_over_z : ndarray of float32, shape (height, 1)
        """
        columns = (np.arange(self.width, dtype=np.float32) - np.float32(self.cx)) / self.fx
        rows = (np.arange(self.height, dtype=np.float32) - np.float32(self.cy)) / self.fy
        return (
            columns[np.newaxis].astype(np.float32),
            rows[:, np.newaxis].astype(np.float32),
        )


def _projection(info: object, side: str) -> list[float]:
    values = getattr(info, 'p', None)
    if values is None:
        values = getattr(info, 'P', None)
    if values is None:
        msg = f'{side} camera_info has no projection matrix P'
        raise CameraError(msg)
    matrix = np.asarray(values, dtype=np.float64).reshape(-1)
    if matrix.size != 12:
        msg = f'{side} camera_info: P has {matrix.size} numbers: expected 12'
        raise CameraError(msg)
    if not np.isfinite(matrix).all():
        msg = f'{side} camera_info: P has numbers that are not finite: {matrix.tolist()}'
        raise CameraError(msg)
    for index, name in ((0, 'P[0] (fx)'), (5, 'P[5] (fy)')):
        if matrix[index] <= 0:
            msg = (
                f'{side} camera_info: {name} is {matrix[index]}: expected a positive focal length'
            )
            raise CameraError(msg)
    return [float(value) for value in matrix]


def _window(info: object, side: str) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
    width, height = int(getattr(info, 'width', 0)), int(getattr(info, 'height', 0))
    binning = (
        int(getattr(info, 'binning_x', 0)) or 1,
        int(getattr(info, 'binning_y', 0)) or 1,
    )
    roi: RegionOfInterest | None = getattr(info, 'roi', None)
    offset = (0, 0)
    if roi is not None:
        offset = int(roi.x_offset), int(roi.y_offset)
        width, height = int(roi.width) or width, int(roi.height) or height
    if width <= 0 or height <= 0:
        msg = (
            f'{side} camera_info: size is {width} x {height}: expected a positive width and height'
        )
        raise CameraError(msg)
    return (width // binning[0], height // binning[1]), offset, binning


def _check_rectified(p_left: Sequence[float], p_right: Sequence[float]) -> None:
    # With different focal lengths or rows, disparity would not determine depth.
    for index, name in ((0, 'P[0] (fx)'), (5, 'P[5] (fy)'), (6, 'P[6] (cy)')):
        if abs(p_left[index] - p_right[index]) > 1e-3 * max(abs(p_left[index]), 1.0):
            msg = (
                f'{name} is {p_left[index]} on the left and {p_right[index]} on the right: '
                'expected a rectified pair, which has the same'
            )
            raise CameraError(msg)
    baseline_m = -p_right[3] / p_right[0]
    if baseline_m <= 0:
        msg = (
            f'right camera_info: P[3] is {p_right[3]}, so the baseline is {baseline_m:.6g} m: '
            'expected P[3] = -fx * baseline, below zero (are left and right swapped?)'
        )
        raise CameraError(msg)
