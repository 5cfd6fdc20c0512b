"""The rectified stereo camera: from calibration to depth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.errors import CameraError

# What no rover's stereo camera exceeds; beyond it, a number is wrong or in another unit.
MAX_SIDE_PX = 16384
MIN_VIEW_DEG, MAX_VIEW_DEG = 0.5, 170.0
MAX_OFF_AXIS_DEG = 80.0
MIN_BASELINE_M, MAX_BASELINE_M = 1e-3, 5.0
# Beyond this share of the width, less than half of what is far away is in both images.
MAX_OFFSET_SHARE = 0.5


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
        If a number is not finite, a size, focal length or the baseline is not positive, or the
        numbers describe no camera: a field of view of less than 0.5 or more than 170 degrees, an
        image centre more than 80 degrees off the optical axis, a baseline of less than 1 mm or
        more than 5 m, principal points further apart than half the width.
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
        self._check_view()
        self._check_stereo()

    def _check_view(self) -> None:
        for side, focal, centre in (('width', 'fx', 'cx'), ('height', 'fy', 'cy')):
            size_px, focal_px = getattr(self, side), getattr(self, focal)
            if size_px > MAX_SIDE_PX:
                raise CameraError(f'{side} is {size_px}: expected at most {MAX_SIDE_PX} pixels')
            view_deg = 2 * math.degrees(math.atan(size_px / 2 / focal_px))
            if not MIN_VIEW_DEG <= view_deg <= MAX_VIEW_DEG:
                raise CameraError(
                    f'{focal} is {focal_px:g} pixels and {side} {size_px}, a field of view of '
                    f'{view_deg:.3g} degrees: expected {MIN_VIEW_DEG:g} to {MAX_VIEW_DEG:g}'
                )
            off_px = (size_px - 1) / 2 - getattr(self, centre)
            off_deg = math.degrees(math.atan(abs(off_px) / focal_px))
            if off_deg > MAX_OFF_AXIS_DEG:
                raise CameraError(
                    f'{centre} is {getattr(self, centre):g} and {side} {size_px}, an image centre '
                    f'{off_deg:.3g} degrees off the optical axis: expected at most '
                    f'{MAX_OFF_AXIS_DEG:g}'
                )

    def _check_stereo(self) -> None:
        if not MIN_BASELINE_M <= self.baseline_m <= MAX_BASELINE_M:
            raise CameraError(
                f'the baseline is {self.baseline_m:g} m: expected {MIN_BASELINE_M:g} to '
                f'{MAX_BASELINE_M:g} m; is it in another unit?'
            )
        if abs(self.disparity_offset) > MAX_OFFSET_SHARE * self.width:
            raise CameraError(
                f'cx is {self.cx:g} on the left and {self.cx_right:g} on the right, '
                f'{abs(self.disparity_offset):.0f} pixels apart: expected at most half the '
                f'width, {self.width / 2:g}'
            )

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
            baseline_m=_baseline_m(p_left, p_right),
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

    def mirrored(self) -> StereoCamera:
        """Return the camera of images with their rows in reverse order."""
        return replace(self, cy=self.height - 1 - self.cy)

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
    matrix = np.asarray(values, dtype=np.float64).ravel()
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
    for index, expected in ((1, 0.0), (4, 0.0), (8, 0.0), (9, 0.0), (10, 1.0), (11, 0.0)):
        if abs(matrix[index] - expected) > 1e-6 * max(1.0, matrix[0]):
            msg = (
                f'{side} camera_info: P[{index}] is {matrix[index]:g}: expected {expected:g}, as '
                'in a rectified camera without skew'
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
    for index, name in (
        (0, 'P[0] (fx)'),
        (5, 'P[5] (fy)'),
        (6, 'P[6] (cy)'),
        (7, 'P[7] (-fy * vertical baseline)'),
    ):
        if abs(p_left[index] - p_right[index]) > 1e-3 * max(abs(p_left[index]), 1.0):
            msg = (
                f'{name} is {p_left[index]} on the left and {p_right[index]} on the right: '
                'expected a rectified pair, which has the same'
            )
            raise CameraError(msg)
    baseline_m = _baseline_m(p_left, p_right)
    if baseline_m <= 0:
        msg = (
            f'right camera_info: P[3] is {p_right[3]}, so the baseline is {baseline_m:.6g} m: '
            'expected P[3] = -fx * baseline, below zero (are left and right swapped?)'
        )
        if p_left[3]:
            msg += f'; P[3] of the left one is {p_left[3]}: expected 0'
        raise CameraError(msg)


def _baseline_m(p_left: Sequence[float], p_right: Sequence[float]) -> float:
    # The left P[3] is 0 unless both cameras are described relative to a third place.
    return (p_left[3] - p_right[3]) / p_right[0]
