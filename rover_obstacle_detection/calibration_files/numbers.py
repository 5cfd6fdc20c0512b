"""A stereo camera given as numbers, alone or in place of some values of a calibration."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace

from rover_obstacle_detection.detection.geometry.camera import MAX_VIEW_DEG, MIN_VIEW_DEG
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.messages.calibration import CameraInfo

Size = tuple[int, int]
Cameras = tuple[CameraInfo, CameraInfo]

_IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class CameraNumbers:
    """Numbers of the rectified camera; those that are None are not given.

    Parameters
    ----------
    fx, fy : float, optional
        Focal lengths, pixels. Without `fy`, the pixels keep their shape, or are square.
    cx, cy : float, optional
        Principal point of the left camera, pixels. By default, the image centre.
    cx_right : float, optional
        Column of the right camera's principal point. By default, it moves along with `cx`.
    baseline_m : float, optional
    hfov_deg : float, optional
        Horizontal field of view, in place of `fx`.
    """

    fx: float | None = None
    fy: float | None = None
    cx: float | None = None
    cy: float | None = None
    cx_right: float | None = None
    baseline_m: float | None = None
    hfov_deg: float | None = None

    @property
    def are_given(self) -> bool:
        """Whether there is any number."""
        return any(value is not None for value in astuple(self))

    @property
    def lacking(self) -> tuple[str, ...]:
        """Names of what a stereo camera needs in addition."""
        has_focal = self.fx is not None or self.hfov_deg is not None
        return ('fx (or hfov)',) * (not has_focal) + ('baseline',) * (self.baseline_m is None)

    def __str__(self) -> str:
        """Return the numbers as they are given on the command line."""
        options = {
            '--fx': self.fx,
            '--fy': self.fy,
            '--cx': self.cx,
            '--cy': self.cy,
            '--cx-right': self.cx_right,
            '--baseline': self.baseline_m,
            '--hfov': self.hfov_deg,
        }
        return ' '.join(
            f'{name} {value:g}' for name, value in options.items() if value is not None
        )

    def cameras(self, size: Size) -> Cameras:
        """Make the cameras of rectified images from these numbers alone.

        Parameters
        ----------
        size : tuple of int
            Width and height of the images, pixels.

        Raises
        ------
        CameraError
            If the field of view is out of range.
        """
        width, height = size
        k = (1.0, 0.0, (width - 1) / 2, 0.0, 1.0, (height - 1) / 2, 0.0, 0.0, 1.0)
        left, right = self.applied((rectified_camera(size, k), rectified_camera(size, k)))
        # K as in P: numbers describe rectified images.
        return rectified_camera(size, left.p), rectified_camera(size, right.p)

    def applied(self, cameras: Cameras) -> Cameras:
        """Replace the values of the rectified camera that are given.

        Raises
        ------
        CameraError
            If the field of view is out of range.
        """
        left, right = list(cameras[0].p), list(cameras[1].p)
        scale_x, scale_y, first_x, first_y, width = _window(cameras[0])
        baseline_m = self.baseline_m
        if baseline_m is None:
            baseline_m = (left[3] - right[3]) / right[0] if right[0] else 0.0
        fx, fy = self._fx(width), self.fy
        if fx is not None:
            shape = left[5] / left[0] if left[0] else scale_y / scale_x
            left[0] = right[0] = fx * scale_x
            left[5] = right[5] = left[0] * shape
        if fy is not None:
            left[5] = right[5] = fy * scale_y
        if self.cx is not None:
            moved = self.cx * scale_x + first_x - left[2]
            left[2] += moved
            right[2] += moved
        if self.cx_right is not None:
            scale_right, _, first_right, _, _ = _window(cameras[1])
            right[2] = self.cx_right * scale_right + first_right
        if self.cy is not None:
            left[6] = right[6] = self.cy * scale_y + first_y
        left[3], right[3] = 0.0, -right[0] * baseline_m
        left[10] = right[10] = 1.0
        return replace(cameras[0], p=tuple(left)), replace(cameras[1], p=tuple(right))

    def _fx(self, width: float) -> float | None:
        if self.hfov_deg is None:
            return self.fx
        if not MIN_VIEW_DEG <= self.hfov_deg <= MAX_VIEW_DEG:
            raise CameraError(
                f'hfov is {self.hfov_deg:g} degrees: expected {MIN_VIEW_DEG:g} to {MAX_VIEW_DEG:g}'
            )
        return width / 2 / math.tan(math.radians(self.hfov_deg) / 2)


def rectified_camera(size: Size, projection: tuple[float, ...]) -> CameraInfo:
    """Make the camera of images that are already rectified.

    Parameters
    ----------
    size : tuple of int
        Width and height, pixels.
    projection : tuple of 9 or 12 float
        Matrix of the rectified image, row-major.
    """
    columns = len(projection) // 3
    rows = [projection[columns * row : columns * (row + 1)] for row in range(3)]
    return CameraInfo(
        width=size[0],
        height=size[1],
        distortion_model='plumb_bob',
        d=(),
        k=tuple(value for row in rows for value in row[:3]),
        r=_IDENTITY,
        p=tuple(value for row in rows for value in (*row, 0.0)[:4]),
    )


def _window(info: CameraInfo) -> tuple[int, int, int, int, float]:
    """Return binning and offset of the images within the calibrated ones, and their width."""
    scale_x, scale_y = info.binning_x or 1, info.binning_y or 1
    first_x = first_y = 0
    width = info.width
    if info.roi is not None:
        first_x, first_y, width = info.roi.x_offset, info.roi.y_offset, info.roi.width or width
    return scale_x, scale_y, first_x, first_y, width / scale_x
