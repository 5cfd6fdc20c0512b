"""One stereo pair and what is known about it: the input of every stage."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.images.grey_pair import GreyPair


@dataclass(frozen=True, eq=False)
class Frame:
    """A grey stereo pair with its camera.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
        Left and right image.
    camera : StereoCamera
        Of the images' size.
    gravity : Gravity, optional
        The vertical, where it is known.
    excluded : ndarray of bool, shape (height, width), optional
        Pixels of the left image that are never judged: they show the rover, were left empty by the
        rectification or, after matching, lie out of range.
    """

    pair: GreyPair
    camera: StereoCamera
    gravity: Gravity | None = None
    excluded: NDArray[np.bool_] | None = None

    def mirrored(self) -> Frame:
        """Reverse the rows: what an upside-down camera sees becomes upright.

        This shows the world in a mirror. Left stays left, so the disparities stay as they are, and
        what is found in the left image lies in the left image. Turning both images by 180 degrees
        and exchanging them would give the view of the right camera instead.
        """
        left, right = (np.ascontiguousarray(image[::-1]) for image in self.pair)
        mask = self.excluded
        return Frame(
            (left, right),
            self.camera.mirrored(),
            self.gravity and self.gravity.mirrored(),
            None if mask is None else np.ascontiguousarray(mask[::-1]),
        )

    def resized(self, camera: StereoCamera) -> Frame:
        """Resample the images. A new pixel is excluded if most of what it covers is.

        Parameters
        ----------
        camera : StereoCamera
            Of the new size.
        """
        if camera.shape == self.camera.shape:
            return self
        size = camera.width, camera.height
        left, right = (
            np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
            for image in self.pair
        )
        mask = self.excluded
        if mask is not None:
            share = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            mask = np.asarray(share > 0.5)
        return replace(self, pair=(left, right), camera=camera, excluded=mask)
