"""Distortion of the lenses that rectification did not take away."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair

Image = NDArray[np.float32]

_MARGIN_PX = 4
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

    def growth(self, x: Image, y: Image) -> Image:
        """How fast the radius at which a point is seen grows with its own: 1 if straight."""
        square = x * x + y * y
        k1, k2, k3 = (np.float32(each) for each in self.coefficients)
        grown = ((7 * k3 * square + 5 * k2) * square + 3 * k1) * square + 1
        return np.asarray(grown, np.float32)


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
        return max(float(bend.mean()) for bend in self._bends_px(camera))

    def most_bend_px(self, camera: StereoCamera) -> float:
        """How far the lens that bends more moves the pixel that it moves most."""
        return max(float(bend.max()) for bend in self._bends_px(camera))

    def moved_px(self, camera: StereoCamera, before: Lenses) -> float:
        """How far pixels are moved from where other lenses move them, mean over the image."""
        both = zip(self._signed_bends_px(camera), before._signed_bends_px(camera), strict=True)
        return max(float(np.abs(now - then).mean()) for now, then in both)

    def _bends_px(self, camera: StereoCamera) -> list[Image]:
        return [np.abs(bend) for bend in self._signed_bends_px(camera)]

    def _signed_bends_px(self, camera: StereoCamera) -> list[Image]:
        """How far out each lens moves some pixels all over the image."""
        bends = []
        for lens, offset_px in ((self.left, 0.0), (self.right, camera.disparity_offset)):
            x, y = _rays(camera, offset_px)
            x, y = (_some(each.ravel()) for each in (x, y))
            radius_px = np.hypot(x * camera.fx, y[:, np.newaxis] * camera.fy)
            bends.append(np.asarray(lens.stretch(x, y[:, np.newaxis]) * radius_px, np.float32))
        return bends

    def straightened(self, pair: GreyPair, camera: StereoCamera) -> GreyPair:
        """Show what straight lenses would.

        Parameters
        ----------
        pair : tuple of two ndarray of uint8, shape (height, width)
        camera : StereoCamera
            Of the images' size.
        """
        left, right = pair
        if self.left:
            left = _sampled(left, *self.left_places(camera))
        if self.right:
            right = _sampled(right, *_seen_places(camera, camera.disparity_offset, self.right))
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

    def unseen(self, disparity: Image, camera: StereoCamera) -> NDArray[np.bool_]:
        """Find pixels of the straightened left image that are matched with what no eye saw.

        Parameters
        ----------
        disparity : ndarray of float32, shape (height, width)
            Pixels, the camera's offset taken off; 0 where there is no match.
        camera : StereoCamera
            Of the disparity's size.

        Notes
        -----
        A straightened image goes on beyond what its eye saw, as its border does.
        """
        unseen = np.zeros(disparity.shape, np.bool_)
        if self.left:
            unseen |= ~_shown(camera, 0.0, self.left)
        if self.right:
            shown = _shown(camera, camera.disparity_offset, self.right).astype(np.uint8)
            columns = np.arange(camera.width, dtype=np.float32) - disparity
            columns = columns - np.float32(camera.disparity_offset)
            rows = np.arange(camera.height, dtype=np.float32)[:, np.newaxis]
            unseen |= (
                cv2.remap(
                    shown,
                    columns,
                    np.ascontiguousarray(np.broadcast_to(rows, columns.shape)),
                    cv2.INTER_NEAREST,
                    borderMode=cv2.BORDER_REPLICATE,
                )
                == 0
            )
        return unseen & (disparity > 0)

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
            NaN where that is not found: far out the polynomial may turn back.
        """
        return _straight_places(camera, 0.0, self.left)

    def straight_right_places(self, camera: StereoCamera) -> tuple[Image, Image]:
        """Give the same of the right image."""
        return _straight_places(camera, camera.disparity_offset, self.right)


STRAIGHT_LENSES = Lenses()


def _rays(camera: StereoCamera, principal_point_px: float) -> tuple[Image, Image]:
    """Direction of each column and row of an eye.

    ``principal_point_px`` is how far to the left of the left eye's its principal point lies.
    """
    x, y = camera.rays()
    return x + np.float32(principal_point_px / camera.fx), y


def _some(values: Image) -> Image:
    """Take about one of eight, the first and the last among them."""
    return values[np.linspace(0, values.size - 1, max(2, values.size // 8)).astype(np.intp)]


def _seen_places(
    camera: StereoCamera, principal_point_px: float, lens: LensDistortion
) -> tuple[Image, Image]:
    """Where an eye shows what a straight one would at each pixel."""
    x, y = _rays(camera, principal_point_px)
    stretch = lens.stretch(x, y)
    columns = np.arange(camera.width, dtype=np.float32) + stretch * x * np.float32(camera.fx)
    rows = np.arange(camera.height, dtype=np.float32)[:, np.newaxis]
    return columns, np.asarray(rows + stretch * y * np.float32(camera.fy), np.float32)


def _shown(
    camera: StereoCamera, principal_point_px: float, lens: LensDistortion
) -> NDArray[np.bool_]:
    """Pixels of a straightened image that its eye saw, with what matching looks at around them.

    Where the polynomial turns back the eye saw something else.
    """
    columns, rows = _seen_places(camera, principal_point_px, lens)
    shown = (columns >= 0) & (columns <= camera.width - 1)
    shown &= (rows >= 0) & (rows <= camera.height - 1)
    shown &= lens.growth(*_rays(camera, principal_point_px)) > 0
    kernel = np.ones((2 * _MARGIN_PX + 1,) * 2, np.uint8)
    # Beyond the image lies what matching replicates anyway, lens or no lens.
    return np.asarray(cv2.erode(shown.astype(np.uint8), kernel) > 0)


def _straight_places(
    camera: StereoCamera, principal_point_px: float, lens: LensDistortion
) -> tuple[Image, Image]:
    """Where a straight eye would show what one shows at each pixel."""
    seen_x, seen_y = _rays(camera, principal_point_px)
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
