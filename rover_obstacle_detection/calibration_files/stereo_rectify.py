"""Compute the rectification of two cameras from their lenses and their relative pose."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from rover_obstacle_detection.calibration_files.numbers import Cameras, Size
from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.messages.calibration import CameraInfo

_NO_DISTORTION = (0.0, 0.0, 0.0, 0.0)
_PLUMB_BOB_COUNT = 5

PINHOLE, FISHEYE = 'rational_polynomial', 'equidistant'


@dataclass(frozen=True)
class Lens:
    """A camera before rectification.

    Parameters
    ----------
    size : tuple of int
        Width and height, pixels.
    k : tuple of 9 float
        Intrinsic matrix, row-major.
    d : tuple of float
        Distortion coefficients.
    model : str
        ``rational_polynomial``, which includes ``plumb_bob``, or ``equidistant``.
    """

    size: Size
    k: tuple[float, ...]
    d: tuple[float, ...]
    model: str = PINHOLE

    @classmethod
    def pinhole(
        cls, size: Size, intrinsics: tuple[float, ...], d: tuple[float, ...], model: str
    ) -> Lens:
        """Make a lens from fx, fy, cx and cy."""
        fx, fy, cx, cy = intrinsics
        return cls(size, (fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0), d, model)

    def with_rectification(self, r: tuple[float, ...], p: tuple[float, ...]) -> CameraInfo:
        """Return the camera with its rectification and projection matrix."""
        if self.model == PINHOLE and len(self.d) <= _PLUMB_BOB_COUNT:
            # ROS has five coefficients in this model, and at least eight in the other.
            d = self.d + (0.0,) * (_PLUMB_BOB_COUNT - len(self.d))
            return CameraInfo(*self.size, 'plumb_bob', d, self.k, r, p)
        return CameraInfo(*self.size, self.model, self.d, self.k, r, p)


def rectified(
    left: Lens, right: Lens, rotation: tuple[float, ...], translation: tuple[float, ...]
) -> Cameras:
    """Compute R and P of both cameras, so that the rectified images have no black border.

    Parameters
    ----------
    left, right : Lens
    rotation : tuple of 9 float
    translation : tuple of 3 float
        ``rotation @ point + translation`` takes a point from the left camera to the right one,
        metres.

    Raises
    ------
    CameraError
        If the cameras contradict each other or cannot be rectified.
    """
    if left.size != right.size:
        raise CameraError(
            f'the left camera is {left.size[0]} x {left.size[1]}, the right one {right.size[0]} '
            f'x {right.size[1]}: expected the same size'
        )
    if left.model != right.model:
        raise CameraError('one camera is a fisheye, the other is not: expected the same model')
    for side, lens in (('left', left), ('right', right)):
        focal = min(lens.k[0], lens.k[4])
        if focal <= 0:
            raise CameraError(
                f'the {side} camera has a focal length of {focal:g}: expected more than 0'
            )
    pose = np.reshape(rotation, (3, 3))
    if not np.allclose(pose @ pose.T, np.identity(3), atol=1e-3):
        raise CameraError(f'the rotation between the cameras is {rotation}: expected a rotation')
    k_left, k_right = (np.reshape(lens.k, (3, 3)) for lens in (left, right))
    d_left, d_right = (np.array(lens.d or _NO_DISTORTION, np.float64) for lens in (left, right))
    move = np.reshape(translation, (3, 1))
    flags = cv2.CALIB_ZERO_DISPARITY
    try:
        if left.model == FISHEYE:
            r_left, r_right, p_left, p_right, _ = cv2.fisheye.stereoRectify(
                k_left, d_left, k_right, d_right, left.size, pose, move, flags
            )
        else:
            r_left, r_right, p_left, p_right, *_ = cv2.stereoRectify(
                k_left, d_left, k_right, d_right, left.size, pose, move, flags=flags, alpha=0
            )
    except cv2.error as error:
        raise CameraError(
            f'the cameras cannot be rectified: expected focal lengths above 0, a baseline and '
            f'the coefficients of the lens ({error.err})'
        ) from None
    return (
        left.with_rectification(_row_major(r_left), _row_major(p_left)),
        right.with_rectification(_row_major(r_right), _row_major(p_right)),
    )


def _row_major(matrix: object) -> tuple[float, ...]:
    return tuple(float(value) for value in np.ravel(np.asarray(matrix)))
