"""Radial lens distortion that rectification left in the images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters

Image = NDArray[np.float32]


@dataclass(frozen=True)
class LensDistortion:
    """A point at radius r from the optical axis appears at ``r (1 + k1 r^2 + k2 r^4 + k3 r^6)``.

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
        """The three coefficients in order."""
        return self.k1, self.k2, self.k3

    def __bool__(self) -> bool:
        """Whether there is any distortion."""
        return any(self.coefficients)

    def stretch(self, x: Image, y: Image) -> Image:
        """Share of its radius by which each point appears too far out.

        Parameters
        ----------
        x, y : ndarray of float32
            From the principal point, in focal lengths; they broadcast.
        """
        square = x * x + y * y
        k1, k2, k3 = (np.float32(each) for each in self.coefficients)
        return np.asarray(((k3 * square + k2) * square + k1) * square, np.float32)

    def radial_derivative(self, x: Image, y: Image) -> Image:
        """Differentiate the apparent radius by the true one: 1 without distortion."""
        square = x * x + y * y
        k1, k2, k3 = (np.float32(each) for each in self.coefficients)
        derivative = ((7 * k3 * square + 5 * k2) * square + 3 * k1) * square + 1
        return np.asarray(derivative, np.float32)


NO_DISTORTION = LensDistortion()


@dataclass(frozen=True)
class LensView:
    """One camera of the pair with its lens.

    Its *straight* image is the one that a lens without distortion would show.

    Parameters
    ----------
    lens : LensDistortion
    camera : StereoCamera
    offset_px : float
        How far its principal point lies to the left of the left camera's.
    """

    lens: LensDistortion
    camera: StereoCamera
    offset_px: float

    def rays(self) -> tuple[Image, Image]:
        """Direction of each column, shape (1, width), and each row, shape (height, 1)."""
        x, y = self.camera.rays()
        return x + np.float32(self.offset_px / self.camera.fx), y

    def bend_px(self) -> Image:
        """How far outwards the lens moves the pixels of a coarse grid."""
        x, y = (_every_eighth(each.ravel()) for each in self.rays())
        y = y[:, np.newaxis]
        radius_px = np.hypot(x * self.camera.fx, y * self.camera.fy)
        return np.asarray(self.lens.stretch(x, y) * radius_px, np.float32)

    def distorted_places(self) -> tuple[Image, Image]:
        """Column and row in the image of each pixel of the straight image."""
        x, y = self.rays()
        stretch = self.lens.stretch(x, y)
        columns = np.arange(self.camera.width, dtype=np.float32)
        rows = np.arange(self.camera.height, dtype=np.float32)[:, np.newaxis]
        return (
            columns + stretch * x * np.float32(self.camera.fx),
            np.asarray(rows + stretch * y * np.float32(self.camera.fy), np.float32),
        )

    def straight_places(self, parameters: RectificationParameters) -> tuple[Image, Image]:
        """Column and row in the straight image of each pixel of the image.

        NaN where the inversion does not converge: far out the polynomial may turn back.
        """
        x, y = self.rays()
        scale = np.ones(self.camera.shape, np.float32)
        least = np.float32(parameters.min_stretch)
        for _ in range(parameters.inversion_passes):
            stretched = 1 + self.lens.stretch(x * scale, y * scale)
            former, scale = scale, np.asarray(1 / np.maximum(stretched, least), np.float32)
        unsettled = np.abs(scale - former) > parameters.inversion_tolerance
        scale[unsettled | (stretched <= least)] = np.nan
        principal_column = np.float32(self.camera.cx - self.offset_px)
        return (
            x * scale * np.float32(self.camera.fx) + principal_column,
            y * scale * np.float32(self.camera.fy) + np.float32(self.camera.cy),
        )

    def straightened(
        self, image: NDArray[np.uint8], interpolation: int = cv2.INTER_CUBIC
    ) -> NDArray[np.uint8]:
        """Straight image; what lies outside the image replicates its border."""
        if not self.lens:
            return image
        return _sampled(image, *self.distorted_places(), interpolation)

    def seen(self, reach_px: int) -> NDArray[np.bool_]:
        """Pixels of the straight image that the image shows, with all pixels within a reach.

        Pixels beyond the border of the straight image do not count.
        """
        columns, rows = self.distorted_places()
        seen = (columns >= 0) & (columns <= self.camera.width - 1)
        seen &= (rows >= 0) & (rows <= self.camera.height - 1)
        # Where the polynomial turns back the image shows something else.
        seen &= self.lens.radial_derivative(*self.rays()) > 0
        kernel = np.ones((2 * reach_px + 1,) * 2, np.uint8)
        return np.asarray(cv2.erode(seen.astype(np.uint8), kernel) > 0)


@dataclass(frozen=True)
class Lenses:
    """Distortion of both lenses.

    Parameters
    ----------
    left, right : LensDistortion
    """

    left: LensDistortion = NO_DISTORTION
    right: LensDistortion = NO_DISTORTION

    def __bool__(self) -> bool:
        """Whether either lens has any distortion."""
        return bool(self.left) or bool(self.right)

    def views(self, camera: StereoCamera) -> tuple[LensView, LensView]:
        """Left and right camera with their lenses."""
        return (
            LensView(self.left, camera, 0.0),
            LensView(self.right, camera, camera.disparity_offset),
        )

    def mean_bend_px(self, camera: StereoCamera) -> float:
        """Mean distance by which the worse lens moves pixels."""
        return max(float(np.abs(view.bend_px()).mean()) for view in self.views(camera))

    def max_bend_px(self, camera: StereoCamera) -> float:
        """Largest distance by which either lens moves a pixel."""
        return max(float(np.abs(view.bend_px()).max()) for view in self.views(camera))

    def change_px(self, camera: StereoCamera, former: Lenses) -> float:
        """Mean distance between where these lenses and former ones move pixels."""
        both = zip(self.views(camera), former.views(camera), strict=True)
        return max(float(np.abs(now.bend_px() - then.bend_px()).mean()) for now, then in both)

    def straightened(self, pair: GreyPair, camera: StereoCamera) -> GreyPair:
        """Straight images of a pair of the camera's size."""
        left, right = self.views(camera)
        return left.straightened(pair[0]), right.straightened(pair[1])

    def seen(self, disparity: Image, camera: StereoCamera, reach_px: int) -> NDArray[np.bool_]:
        """Pixels of the straight left image that are matched with what both images show.

        Parameters
        ----------
        disparity : ndarray of float32, shape (height, width)
            Between the straight images, pixels, without the camera's offset.
        camera : StereoCamera
        reach_px : int
            How far around a pixel matching looks.
        """
        left, right = self.views(camera)
        seen = left.seen(reach_px) if self.left else np.ones(disparity.shape, np.bool_)
        if self.right:
            columns = np.arange(camera.width, dtype=np.float32) - disparity
            columns = columns - np.float32(camera.disparity_offset)
            rows = np.arange(camera.height, dtype=np.float32)[:, np.newaxis]
            rows = np.ascontiguousarray(np.broadcast_to(rows, columns.shape))
            in_right = right.seen(reach_px).astype(np.uint8)
            seen &= _sampled(in_right, columns, rows, cv2.INTER_NEAREST) > 0
        return seen


STRAIGHT_LENSES = Lenses()


def _every_eighth(values: Image) -> Image:
    """About one value in eight, among them the first and the last."""
    return values[np.linspace(0, values.size - 1, max(2, values.size // 8)).astype(np.intp)]


def _sampled(
    image: NDArray[np.uint8], columns: Image, rows: Image, interpolation: int
) -> NDArray[Any]:
    sampled = cv2.remap(image, columns, rows, interpolation, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled)
