"""Distortion of the lenses that rectification did not take away."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.image import GreyPair

Image = NDArray[np.float32]

ORDERS = 3
_STRIDE = 8
_INVERSION_STEPS = 12
# Of a radius of a thousand pixels, half a pixel.
_SETTLED_SHARE = 5e-4
_LEAST = np.float32(0.5)


@dataclass(frozen=True)
class LensDistortion:
    """A point at radius r from the optical axis is seen at ``r (1 + k1 r^2 + k2 r^4 + k3 r^6)``.

    Parameters
    ----------
    k1, k2, k3 : float
        As in ``sensor_msgs/CameraInfo`` (Brown 1966); r is in focal lengths.
    """

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0

    @property
    def coefficients(self) -> tuple[float, float, float]:
        """All of them, in order."""
        return self.k1, self.k2, self.k3

    def __bool__(self) -> bool:
        """Whether there is any."""
        return any(self.coefficients)

    def stretch(self, x: Image, y: Image) -> Image:
        """Share of its radius by which each point is seen too far out.

        Parameters
        ----------
        x, y : ndarray of float32
            From the principal point, in focal lengths; one broadcasts over the other.
        """
        square = x * x + y * y
        k1, k2, k3 = (np.float32(each) for each in self.coefficients)
        return np.asarray(((k3 * square + k2) * square + k1) * square, np.float32)


NO_DISTORTION = LensDistortion()


@dataclass(frozen=True)
class Lenses:
    """Both eyes' distortion.

    Parameters
    ----------
    left, right : LensDistortion
    """

    left: LensDistortion = NO_DISTORTION
    right: LensDistortion = NO_DISTORTION

    def __bool__(self) -> bool:
        """Whether either bends."""
        return bool(self.left) or bool(self.right)

    def mean_bend_px(self, camera: StereoCamera) -> float:
        """How far the lens that bends more moves pixels, mean over the image."""
        x, y = (each.ravel()[::_STRIDE] for each in camera.rays())
        radius_px = np.hypot(x, y[:, np.newaxis]) * camera.fx
        return max(
            float(np.mean(np.abs(lens.stretch(x, y[:, np.newaxis])) * radius_px))
            for lens in (self.left, self.right)
        )

    def straightened(self, pair: GreyPair, camera: StereoCamera) -> GreyPair:
        """Show what straight lenses would.

        Parameters
        ----------
        pair : tuple of two ndarray of uint8, shape (height, width)
        camera : StereoCamera
            Of the images' size.
        """
        columns, rows = self.left_places(camera)
        left = _sampled(pair[0], columns, rows) if self.left else pair[0]
        right = pair[1]
        if self.right:
            columns, rows = _seen_places(camera, camera.disparity_offset, self.right)
            right = _sampled(right, columns, rows)
        return left, right

    def straightened_mask(
        self, left_mask: NDArray[np.bool_] | None, camera: StereoCamera
    ) -> NDArray[np.bool_] | None:
        """Mark in the straightened left image what is marked in the left one."""
        if left_mask is None or not self.left:
            return left_mask
        marked = cv2.remap(
            left_mask.astype(np.uint8),
            *self.left_places(camera),
            cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_REPLICATE,
        )
        return np.asarray(marked > 0)

    def left_places(self, camera: StereoCamera) -> tuple[Image, Image]:
        """Where the left image shows what each pixel of its straightened self shows.

        Returns
        -------
        columns, rows : ndarray of float32, shape (height, width)
        """
        return _seen_places(camera, 0.0, self.left)

    def straight_left_places(self, camera: StereoCamera) -> tuple[Image, Image]:
        """Where the straightened left image shows what each pixel of the left image shows.

        Returns
        -------
        columns, rows : ndarray of float32, shape (height, width)
            NaN where the polynomial cannot be inverted: far out it may turn back.
        """
        return _straight_places(camera, 0.0, self.left)

    def straight_right_places(self, camera: StereoCamera) -> tuple[Image, Image]:
        """Give the same of the right image."""
        return _straight_places(camera, camera.disparity_offset, self.right)


STRAIGHT_LENSES = Lenses()


def bent_px(lenses: Lenses, camera: StereoCamera) -> float:
    """Largest distance by which a lens moves a corner or the middle of a side, pixels."""
    columns = np.array([0, camera.width - 1], np.float32)
    x = (columns - np.float32(camera.cx)) / np.float32(camera.fx)
    y = np.array([-camera.cy, 0, camera.height - 1 - camera.cy], np.float32)[:, np.newaxis]
    y = y / np.float32(camera.fy)
    radius_px = np.hypot(x, y) * camera.fx
    return max(
        float(np.abs(lens.stretch(x, y) * radius_px).max()) for lens in (lenses.left, lenses.right)
    )


def _seen_places(
    camera: StereoCamera, principal_point_px: float, lens: LensDistortion
) -> tuple[Image, Image]:
    """Where an eye shows what a straight one would at each pixel.

    ``principal_point_px`` is how far to the left of the left eye's its principal point lies.
    """
    x, y = camera.rays()
    x = x + np.float32(principal_point_px / camera.fx)
    stretch = lens.stretch(x, y)
    columns = np.arange(camera.width, dtype=np.float32) + stretch * x * np.float32(camera.fx)
    rows = np.arange(camera.height, dtype=np.float32)[:, np.newaxis]
    return columns, np.asarray(rows + stretch * y * np.float32(camera.fy), np.float32)


def _straight_places(
    camera: StereoCamera, principal_point_px: float, lens: LensDistortion
) -> tuple[Image, Image]:
    """Where a straight eye would show what one shows at each pixel."""
    seen_x, seen_y = camera.rays()
    seen_x = seen_x + np.float32(principal_point_px / camera.fx)
    scale = np.ones(camera.shape, np.float32)
    for _ in range(_INVERSION_STEPS):
        stretched = 1 + lens.stretch(seen_x * scale, seen_y * scale)
        former, scale = scale, np.asarray(1 / np.maximum(stretched, _LEAST), np.float32)
    unsettled = (np.abs(scale - former) > _SETTLED_SHARE) | (stretched <= _LEAST)
    scale[unsettled] = np.nan
    principal_column = np.float32(camera.cx - principal_point_px)
    columns = seen_x * scale * np.float32(camera.fx) + principal_column
    rows = seen_y * scale * np.float32(camera.fy) + np.float32(camera.cy)
    return columns, rows


def _sampled(image: NDArray[np.uint8], columns: Image, rows: Image) -> NDArray[np.uint8]:
    return np.asarray(
        cv2.remap(image, columns, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE),
        np.uint8,
    )
