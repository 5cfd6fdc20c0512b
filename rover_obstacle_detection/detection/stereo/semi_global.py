"""Dense matching by semi-global block matching (study, section 4.2 step 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters

SUBPIXELS = 16
"""Steps of OpenCV's fixed-point disparity in a pixel."""
MAX_DISPARITY = 2047
"""Largest disparity that fits into OpenCV's 16 bits, pixels."""

_SGBM_MODES = (
    cv2.STEREO_SGBM_MODE_SGBM,
    cv2.STEREO_SGBM_MODE_HH,
    cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    cv2.STEREO_SGBM_MODE_HH4,
)


@dataclass(frozen=True)
class Penalties:
    """SGBM penalties on a disparity change of one pixel (`step`) and of more (`jump`)."""

    step: int
    jump: int


def chosen_penalties(parameters: StereoParameters, default: Penalties) -> Penalties:
    """Return the penalties that the user set, or the default where they are 0, within limits."""
    step = min(parameters.p1 or default.step, parameters.max_penalty - 1)
    jump = max(parameters.p2 or default.jump, step + 1)
    return Penalties(step, min(jump, parameters.max_penalty))


def disparity_range(camera: StereoCamera, nearest_m: float) -> int:
    """Return how many disparities to search so that ``nearest_m`` is still matched.

    ``fx B / Z`` plus the disparity of infinity, as a multiple of 16. At most 0.8 of the image's
    width: more would leave hardly a column that is visible over the whole range.
    """
    widest = camera.disparity_at(nearest_m) + max(camera.disparity_offset, 0.0) + 1
    most = max(16, math.floor(camera.width * 0.8 / 16) * 16)
    return min(max(16, math.ceil(widest / 16) * 16), most)


def semi_global_match(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    search: tuple[int, int],
    penalties: Penalties,
    parameters: StereoParameters,
) -> NDArray[np.int16]:
    """Match two rectified images.

    Parameters
    ----------
    left, right : ndarray of uint8, shape (height, width)
    search : tuple of int
        First disparity and their number, a multiple of 16, pixels.
    penalties : Penalties
    parameters : StereoParameters

    Returns
    -------
    ndarray of int16, shape (height, width)
        Disparity in sixteenths of a pixel; ``(first - 1) * 16`` where there is no match, as in the
        columns at either side that are not visible in the right image over the whole range.
    """
    lowest, count = search
    count = min(count, (MAX_DISPARITY - lowest) // 16 * 16)
    if left.shape[1] + min(lowest, 0) <= max(lowest + count, 0):
        # No column is visible over the whole range. OpenCV would allocate without bound.
        return np.full(left.shape, (lowest - 1) * SUBPIXELS, np.int16)
    matcher = cv2.StereoSGBM.create(
        minDisparity=lowest,
        numDisparities=count,
        blockSize=parameters.block_size_px,
        P1=penalties.step,
        P2=penalties.jump,
        disp12MaxDiff=parameters.disp12_max_diff_px,
        preFilterCap=parameters.prefilter_cap,
        uniquenessRatio=parameters.uniqueness_percent,
        speckleWindowSize=parameters.speckle_size_px,
        speckleRange=parameters.speckle_range_px,
        mode=_SGBM_MODES[parameters.sgbm_mode],
    )
    return np.asarray(matcher.compute(left, right), np.int16)


def plain_disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    camera: StereoCamera,
    count: int,
    penalties: Penalties,
    parameters: StereoParameters,
) -> NDArray[np.float32]:
    """Match without a ground plane.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Disparity in pixels, without the camera's offset; 0 where there is no match, as in the left
        border, where part of the range lies outside the right image.
    """
    lowest = parameters.min_disparity_px
    fixed = semi_global_match(left, right, (lowest, count), penalties, parameters)
    disparity = fixed.astype(np.float32)
    disparity *= np.float32(1 / SUBPIXELS)
    disparity -= np.float32(camera.disparity_offset)
    disparity[(fixed < lowest * SUBPIXELS) | (disparity <= 0)] = 0
    return disparity
