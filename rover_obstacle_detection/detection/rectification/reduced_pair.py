"""The reduced pair that rectification errors are measured in."""

from __future__ import annotations

from dataclasses import dataclass

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair


@dataclass(frozen=True, eq=False)
class ReducedPair:
    """A pair at a fraction of its resolution.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    camera : StereoCamera
        Of the reduced size.
    reduction : float
        Side of a reduced pixel in pixels of the full image.
    """

    pair: GreyPair
    camera: StereoCamera
    reduction: float
