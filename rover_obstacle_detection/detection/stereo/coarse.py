"""A first match over the camera's whole range, at a fraction of the resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.semi_global import (
    Penalties,
    chosen_penalties,
    disparity_range,
)
from rover_obstacle_detection.detection.stereo.warped_matching import warped_disparity


def coarse_camera(camera: StereoCamera, parameters: StereoParameters) -> StereoCamera:
    """Return the camera of the resolution of the coarse match."""
    most = camera.width // parameters.min_coarse_width_px
    reduction = max(1, min(parameters.coarse_reduction, most))
    return camera.resized(camera.width // reduction, max(1, camera.height // reduction))


@dataclass(frozen=True)
class CoarseMatcher:
    """Matches reduced pairs over the whole range of the full-size camera.

    Parameters
    ----------
    full : StereoCamera
        Of the full-size images.
    reduced : StereoCamera
        Of the reduced images.
    parameters : StereoParameters
    """

    full: StereoCamera
    reduced: StereoCamera
    parameters: StereoParameters

    def __call__(self, pair: GreyPair, rows: RowAlignment) -> NDArray[np.float32]:
        """Match a reduced pair whose rows are off.

        Returns
        -------
        ndarray of float32, shape (height, width)
            Disparity in reduced pixels, without the camera's offset; 0 where there is no match.
        """
        p = self.parameters
        # Relative to a plane at infinity: plain matching would lose a wide border at the left,
        # since the search covers a large part of the width.
        infinity = np.zeros(self.reduced.shape, np.float32)
        penalties = chosen_penalties(p, Penalties(p.coarse_p1, p.coarse_p2))
        return warped_disparity(pair, self.reduced, infinity, self._search(), penalties, p, rows)

    def _search(self) -> tuple[int, int]:
        p = self.parameters
        count = p.disparity_range_px or disparity_range(self.full, p.min_range_m)
        return (
            math.floor(p.min_disparity_px * self.reduced.width / self.full.width),
            max(16, math.ceil(count * self.reduced.width / self.full.width / 16) * 16),
        )
