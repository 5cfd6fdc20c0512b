"""Rectify raw images with the calibration's K, D, R and P, as image_proc does."""

from __future__ import annotations

import math
from typing import Any, NoReturn

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.errors import CameraError, ImageError
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration

_PINHOLE_MODELS = ('plumb_bob', 'rational_polynomial', '')
FISHEYE_MODEL = 'equidistant'
# Rectification crops and enlarges; with less, the calibration is of another camera.
_MIN_SEEN_SHARE = 0.25
# Of the raw image; with less, K is in another unit.
_MIN_USED_SHARE = 0.01
# As many as OpenCV knows.
_MAX_COEFFICIENTS = 14


def needs_rectification(info: CameraInfo) -> bool:
    """Return whether raw images of this calibration differ from rectified ones."""
    k, p = np.reshape(info.k, (3, 3)), np.reshape(info.p, (3, 4))[:, :3]
    is_aligned = np.allclose(info.r, np.identity(3).reshape(-1)) and np.allclose(k, p)
    return bool(np.any(info.d)) or not is_aligned


class Rectification:
    """Rectifies the raw images of one camera.

    Parameters
    ----------
    info : CameraInfo
    name : str
        Topic or file of the calibration, for error messages.

    Attributes
    ----------
    seen_share : float
        Share of the rectified image that lies within the raw one.

    Raises
    ------
    CameraError
        If K, D or R is invalid, the distortion model is unknown, or hardly a pixel of the
        rectified image lies within the raw one.

    Notes
    -----
    The maps come from ``cv2.initUndistortRectifyMap`` (``cv2.fisheye`` for equidistant). K and P
    are first converted to the cropped and binned image, as image_geometry does. Pixels that lie
    outside the raw image, also in part, become 0.
    """

    def __init__(self, info: CameraInfo, name: str) -> None:
        self._name = name
        r = np.reshape(info.r, (3, 3))
        if info.k[0] <= 0 or info.k[4] <= 0 or not np.isfinite(info.k).all():
            self._refuse(f'K is {info.k}: expected focal lengths above 0')
        if len(info.d) > _MAX_COEFFICIENTS:
            self._refuse(
                f'D has {len(info.d)} coefficients: expected those of {info.distortion_model}'
            )
        if not np.isfinite(info.d).all():
            self._refuse(f'D is {info.d}: expected finite numbers')
        # Large values would overflow; those of a rotation are at most 1.
        if not (
            np.all(np.abs(r) < 2)
            and np.allclose(r @ r.T, np.identity(3), atol=1e-3)
            and np.linalg.det(r) > 0
        ):
            self._refuse(f'R is {info.r}: expected a rotation')
        if info.distortion_model == FISHEYE_MODEL:
            make_maps: Any = cv2.fisheye.initUndistortRectifyMap
        elif info.distortion_model in _PINHOLE_MODELS:
            make_maps = cv2.initUndistortRectifyMap
        else:
            self._refuse(
                f'distortion_model is {info.distortion_model!r}: expected plumb_bob, '
                f'rational_polynomial or {FISHEYE_MODEL}'
            )
        window, self._size = _window(info)
        k, p = window @ np.reshape(info.k, (3, 3)), window @ np.reshape(info.p, (3, 4))[:, :3]
        distortion = np.asarray(info.d, np.float64)
        try:
            self._columns, self._rows = make_maps(k, distortion, r, p, self._size, cv2.CV_16SC2)
        except cv2.error:
            self._refuse(f'D is {info.d}: expected the coefficients of {info.distortion_model}')
        within = np.full(self._size[::-1], 255, np.uint8)
        self._empty = cv2.remap(within, self._columns, self._rows, cv2.INTER_LINEAR) < 255
        self.seen_share, used = self._shares()
        values = f'with K {info.k}, D {info.d}, R {info.r} and P {info.p}'
        if self.seen_share < _MIN_SEEN_SHARE:
            self._refuse(
                f'{values} only {self.seen_share:.0%} of the rectified image shows anything: '
                f'expected at least {_MIN_SEEN_SHARE:.0%}'
            )
        if used < _MIN_USED_SHARE:
            self._refuse(
                f'{values} the rectified image shows only {used:.2%} of the raw one: expected at '
                f'least {_MIN_USED_SHARE:.0%}'
            )

    def _shares(self) -> tuple[float, float]:
        """Share of the rectified image that lies within the raw one, and of that in a box."""
        width, height = self._size
        column, row = self._columns[..., 0], self._columns[..., 1]
        seen = ~self._empty
        if not seen.any():
            return 0.0, 0.0
        used = math.prod(int(np.ptp(each[seen])) + 1 for each in (column, row))
        return float(seen.mean()), used / (width * height)

    def __call__(self, image: NDArray[Any]) -> NDArray[Any]:
        """Rectify an image.

        Parameters
        ----------
        image : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)

        Raises
        ------
        ImageError
            If its size differs from the calibration.
        """
        height, width = image.shape[:2]
        if (width, height) != self._size:
            msg = (
                f'the image is {width} x {height}, but its calibration {self._name} is for '
                f'{self._size[0]} x {self._size[1]}'
            )
            raise ImageError(msg)
        rectified: NDArray[Any] = cv2.remap(image, self._columns, self._rows, cv2.INTER_LINEAR)
        rectified[self._empty] = 0
        return rectified

    def _refuse(self, reason: str) -> NoReturn:
        msg = f'{self._name}: {reason}'
        raise CameraError(msg)


def _window(info: CameraInfo) -> tuple[NDArray[np.float64], tuple[int, int]]:
    """Return the transform from full-image to cropped and binned pixels, and the new size."""
    binning_x, binning_y = info.binning_x or 1, info.binning_y or 1
    x_offset, y_offset, width, height = 0, 0, info.width, info.height
    if info.roi is not None:
        x_offset, y_offset = info.roi.x_offset, info.roi.y_offset
        width, height = info.roi.width or width, info.roi.height or height
    window = np.array(
        [
            [1 / binning_x, 0, -x_offset / binning_x],
            [0, 1 / binning_y, -y_offset / binning_y],
            [0, 0, 1],
        ]
    )
    return window, (width // binning_x, height // binning_y)


class StereoRectification:
    """Rectifies image pairs; an image that is already rectified is returned unchanged.

    Parameters
    ----------
    calibration : StereoCalibration

    Raises
    ------
    CameraError
        See `Rectification`.
    """

    def __init__(self, calibration: StereoCalibration) -> None:
        self._sides = tuple(
            Rectification(info, calibration.source) if needs_rectification(info) else None
            for info in (calibration.left, calibration.right)
        )

    @property
    def is_needed(self) -> bool:
        """Whether at least one side needs rectification."""
        return any(self._sides)

    def __call__(
        self, left: NDArray[Any], right: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Rectify a pair; see `Rectification.__call__`."""
        rectify_left, rectify_right = self._sides
        return (
            rectify_left(left) if rectify_left else left,
            rectify_right(right) if rectify_right else right,
        )
