"""Dense stereo matching by semi-global block matching (study, section 4.2 step 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera

SUBPIXELS = 16
MAX_PENALTY = 16_000
_SGBM_MODES = (
    cv2.STEREO_SGBM_MODE_SGBM,
    cv2.STEREO_SGBM_MODE_HH,
    cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    cv2.STEREO_SGBM_MODE_HH4,
)


@dataclass(frozen=True)
class Penalties:
    """SGBM's penalties on a change of disparity by one pixel, and by more."""

    one: int
    more: int


def penalties(config: DetectorConfig, own: Penalties) -> Penalties:
    """Take the configured penalties, or the method's own where they are 0."""
    one = round(config.P1) or own.one
    # SGBM sums costs in 16 bits: larger penalties would overflow, and nothing would match.
    one = min(one, MAX_PENALTY - 1)
    return Penalties(one, min(max(round(config.P2) or own.more, one + 1), MAX_PENALTY))


def disparity_range(camera: StereoCamera, nearest_m: float) -> int:
    """Disparities to search, a multiple of 16, so that ``nearest_m`` is still matched.

    ``fx B / Z`` plus the disparity of infinity; at most 0.8 of the image's width, so that not all
    of it is blind border.
    """
    widest = camera.disparity_at(nearest_m) + max(camera.disparity_offset, 0.0) + 1
    most = max(16, math.floor(camera.width * 0.8 / 16) * 16)
    return min(_next_multiple(widest, 16), most)


def semi_global_match(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    lowest: int,
    count: int,
    config: DetectorConfig,
    penalty: Penalties,
) -> NDArray[np.int16]:
    """Match two rectified images.

    Parameters
    ----------
    left, right : ndarray of uint8, shape (height, width)
    lowest, count : int
        First disparity searched and how many, a multiple of 16, pixels.
    config : DetectorConfig
        Block size, uniqueness, speckle filter, left-right check, mode.
    penalty : Penalties

    Returns
    -------
    ndarray of int16, shape (height, width)
        Disparity in sixteenths of a pixel; ``(lowest - 1) * 16`` where there is no match, as in
        the columns on either side that the other eye does not see over the whole range.
    """
    if left.shape[1] + min(lowest, 0) <= max(lowest + count, 0):
        # No column is seen over the whole range; OpenCV would ask for memory without end.
        return np.full(left.shape, (lowest - 1) * SUBPIXELS, np.int16)
    matcher = cv2.StereoSGBM.create(
        minDisparity=lowest,
        numDisparities=count,
        blockSize=config.block_size,
        P1=penalty.one,
        P2=penalty.more,
        disp12MaxDiff=config.disp12_max_diff,
        preFilterCap=config.prefilter_cap,
        uniquenessRatio=round(config.uniqueness_ratio),
        speckleWindowSize=config.speckle_size,
        speckleRange=config.speckle_range,
        mode=_SGBM_MODES[config.sgbm_mode],
    )
    return np.asarray(matcher.compute(left, right), np.int16)


def plain_disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    camera: StereoCamera,
    count: int,
    config: DetectorConfig,
    penalty: Penalties,
) -> NDArray[np.float32]:
    """Match and bring to true disparity.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match. The left border, where
        part of the range lies outside the right image, has none.
    """
    lowest = config.min_disparity
    fixed = semi_global_match(left, right, lowest, count, config, penalty)
    fixed[:, : max(lowest + count - 1, 0)] = (lowest - 1) * SUBPIXELS
    disparity = fixed.astype(np.float32)
    disparity *= np.float32(1 / SUBPIXELS)
    disparity -= np.float32(camera.disparity_offset)
    disparity[(fixed < lowest * SUBPIXELS) | (disparity <= 0)] = 0
    return disparity


def _next_multiple(value: float, of: int) -> int:
    return max(of, math.ceil(value / of) * of)
