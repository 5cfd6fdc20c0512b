"""The rectification error of a pair, and its correction."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment

RECALIBRATE_PX = 1.0
"""Rows off, or lens distortion, from which users are told to calibrate again."""


@dataclass(frozen=True, eq=False)
class Remapping:
    """From the straight left image to the left image, each pixel from its nearest one.

    Parameters
    ----------
    pixels : ndarray of int32, shape (height, width)
        Flat index in the straight image of each pixel of the image.
    shown : ndarray of bool, shape (height, width)
        Pixels of the image that the straight image shows. The others map to a pixel nearby.
    """

    pixels: NDArray[np.int32]
    shown: NDArray[np.bool_]

    def __call__(self, array: NDArray[Any], fill: Any = None) -> NDArray[Any]:
        """Remap an array of shape (height, width, ...).

        Pixels that the straight image does not show get `fill`; None leaves them the value of a
        pixel nearby.
        """
        remapped = np.take(array.reshape(-1, *array.shape[2:]), self.pixels, axis=0)
        if fill is not None:
            remapped[~self.shown] = fill
        return remapped

    def mirrored(self) -> Remapping:
        """Return the same for images with their rows in reverse order."""
        height, width = self.pixels.shape
        row, column = np.divmod(self.pixels[::-1], width)
        pixels = ((height - 1 - row) * width + column).astype(np.int32)
        return Remapping(pixels, np.ascontiguousarray(self.shown[::-1]))

    def rays(self, camera: StereoCamera) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Direction of each pixel's nearest one in the straight image, NaN where it has none.

        Returns
        -------
        x_over_z, y_over_z : ndarray of float32, shape (height, width)
        """
        x, y = (np.broadcast_to(each, camera.shape) for each in camera.rays())
        return self(x, np.nan), self(y, np.nan)


@dataclass(frozen=True)
class Correction:
    """Residual rectification error, as measured in one pair, and its correction.

    Lens distortion is corrected by resampling the images, rows while matching.

    Parameters
    ----------
    rows : RowAlignment
        Rows by which the right image is off, pixels.
    lenses : Lenses
        Distortion of both lenses.
    parameters : RectificationParameters
    """

    rows: RowAlignment = STRAIGHT
    lenses: Lenses = STRAIGHT_LENSES
    parameters: RectificationParameters = field(
        default=RectificationParameters(), repr=False, compare=False
    )

    def reduced(self, reduction: float) -> Correction:
        """Return the same for images reduced by a factor."""
        return replace(self, rows=self.rows.reduced(reduction))

    def mirrored(self) -> Correction:
        """Return the same for images with their rows in reverse order."""
        return replace(self, rows=self.rows.mirrored())

    def straightened(self, frame: Frame) -> Frame:
        """Images and excluded pixels as lenses without distortion would show them."""
        if not self.lenses:
            return frame
        mask = frame.excluded
        if mask is not None:
            left, _ = self.lenses.views(frame.camera)
            mask = left.straightened(mask.astype(np.uint8), cv2.INTER_NEAREST) > 0
        pair = self.lenses.straightened(frame.pair, frame.camera)
        return replace(frame, pair=pair, excluded=mask)

    def unseen(
        self, disparity: NDArray[np.float32], camera: StereoCamera
    ) -> NDArray[np.bool_] | None:
        """Pixels matched with what one of the images does not show.

        A straight image replicates its border beyond what the image shows.

        Parameters
        ----------
        disparity : ndarray of float32, shape (height, width)
            Between the straight images, pixels, without the camera's offset; 0 where there is no
            match.
        camera : StereoCamera
            Of the disparity's size.

        Returns
        -------
        ndarray of bool, shape (height, width), or None
            None if neither lens has distortion.
        """
        if not self.lenses:
            return None
        seen = self.lenses.seen(disparity, camera, self.parameters.match_reach_px)
        return ~seen & (disparity > 0)

    def to_left_image(self, camera: StereoCamera) -> Remapping | None:
        """Remapping from the straight left image to the left image.

        None if the left lens has no distortion.
        """
        if not self.lenses.left:
            return None
        left, _ = self.lenses.views(camera)
        columns, rows = (np.rint(each) for each in left.straight_places(self.parameters))
        shown = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
        own_rows, own_columns = np.mgrid[: camera.height, : camera.width]
        rows = np.clip(np.where(np.isnan(rows), own_rows, rows), 0, camera.height - 1)
        columns = np.clip(np.where(np.isnan(columns), own_columns, columns), 0, camera.width - 1)
        return Remapping((rows * camera.width + columns).astype(np.int32), shown)


UNCORRECTED = Correction()
