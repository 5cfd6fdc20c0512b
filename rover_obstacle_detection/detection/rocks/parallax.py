"""Photometric evidence that a pixel stands up, from the right image alone."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.network.tiles import Window
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.terrain import Terrain

Image = NDArray[np.float32]

STEP_SHARES = (0.5, 1.0, 2.0)
"""Heights, over the rover's step, at which a pixel is tried whatever was matched."""

# Changing these changes what the network has learned to read: see `outline_features`.
_BRIGHTNESS_WINDOW_PX = 41
_WINDOW_PX = 3
_MIN_GREY_NOISE = 1.0
# Share of the camera's height. What stands nearly as high as the camera hides ground far away, and
# ground in line with the camera hides none.
_MIN_DESCENT_SHARE = 0.05


def parallax_evidence(
    stereo: Stereo, terrain: Terrain, max_step_m: float, window: Window
) -> Image:
    """Compare how well the right image fits the local ground and what stands up from it.

    Parameters
    ----------
    stereo : Stereo
    terrain : Terrain
    max_step_m : float
        The rover's step.
    window : tuple of two slices
        Rows and columns to look at.

    Returns
    -------
    ndarray of float32, shape (1 + len(STEP_SHARES), rows, columns)
        Log likelihood ratio of a raised pixel against one on the local ground: first as matched,
        then at each share of the step. Positive: raised. Negative: the disparity of something near
        has spread over ground. 0 without 3D, as high as the camera, and beyond the border of the
        right image.

    Notes
    -----
    The ratio is the squared grey-level difference of the ground hypothesis less that of the other,
    over the image noise. Blocks and smoothness make
    disparity coherent where nothing supports it, and flatten what is small and far. This looks at
    3 x 3 pixels alone, less the difference in brightness of the ground around them.

    A point at height h over the ground, to which the ray descends by b from the camera, hides
    ground of disparity d_g with ``1 / d_g = (1 + h / b) / d``. With the camera's height over that
    ground ``e = h + b``, ``d = d_g / (1 - h / e)``.
    """
    near, disparity = terrain.within(window), stereo.disparity[window]
    evidence = np.zeros((1 + len(STEP_SHARES), *disparity.shape), np.float32)
    if not near.measured.any():
        return evidence
    height_m, camera_m = np.where(near.measured, near.height_m, 0), near.camera_m
    least_m = np.float32(_MIN_DESCENT_SHARE * stereo.ground.height_m)
    descent_m = camera_m - height_m
    usable = near.measured & (descent_m > least_m) & (camera_m > least_m)
    # Limiting the divisor changes only what is not usable.
    on_ground = disparity * descent_m
    on_ground /= np.maximum(camera_m, least_m)
    usable &= on_ground > 0
    right = _WarpedRight.of(stereo, window)
    from_ground = right.difference(right.columns - on_ground)
    brightness = _mean_around(from_ground, usable)
    squares = _squared(from_ground, brightness)
    noise = np.float32(max(stereo.grey_noise, _MIN_GREY_NOISE) ** 2)
    scaled = on_ground * camera_m
    for share, found in zip((0, *STEP_SHARES), evidence, strict=True):
        possible = usable
        if share:
            below_m = camera_m - np.float32(share * max_step_m)
            possible = usable & (below_m > least_m)
            columns = right.columns - scaled / np.maximum(below_m, least_m, out=below_m)
        else:
            columns = right.columns - disparity
        gain = _squared(right.difference(columns), brightness)
        np.subtract(squares, gain, out=gain)
        gain[~(possible & (columns >= 0))] = 0
        cv2.blur(gain, (_WINDOW_PX, _WINDOW_PX), dst=found)
        found /= noise
    return evidence


@dataclass(frozen=True, eq=False)
class _WarpedRight:
    """The right image as a window of the left one would show it, for any disparity.

    Parameters
    ----------
    left : ndarray of uint8, shape (rows, columns)
        The window.
    right : ndarray of uint8, shape (height, width)
        The whole right image.
    columns, rows : ndarray of float32, shape (rows, columns)
        Where the right image shows what is infinitely far away.
    """

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    columns: Image
    rows: Image

    @classmethod
    def of(cls, stereo: Stereo, window: Window) -> _WarpedRight:
        rows, columns = window
        camera = stereo.frame.camera
        column = np.arange(camera.width, dtype=np.float32)[columns]
        at_infinity = column - np.float32(camera.disparity_offset)
        return cls(
            stereo.frame.pair[0][window],
            stereo.frame.pair[1],
            at_infinity - stereo.rows.added_disparity(camera)[rows],
            stereo.rows.rows(camera, column)[rows],
        )

    def difference(self, columns: Image) -> NDArray[np.int16]:
        """Grey level of the left image less that of the right one in the given columns."""
        seen = cv2.remap(
            self.right, columns, self.rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(cv2.subtract(self.left, seen, dtype=cv2.CV_16S), np.int16)


def _squared(difference: NDArray[np.int16], brightness: Image) -> Image:
    """Square the differences beyond that in brightness."""
    beyond = difference - brightness
    beyond *= beyond
    return beyond


def _mean_around(difference: NDArray[np.int16], where: NDArray[np.bool_]) -> Image:
    """Mean of the marked pixels around each pixel."""
    # Sums of whole numbers are fast and exact.
    size = (_BRIGHTNESS_WINDOW_PX, _BRIGHTNESS_WINDOW_PX)
    share = cv2.boxFilter(where.view(np.uint8), cv2.CV_32F, size)
    mean = cv2.boxFilter(difference * where, cv2.CV_32F, size)
    return np.asarray(mean / np.maximum(share, np.float32(1e-6)), np.float32)
