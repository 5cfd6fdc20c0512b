"""Matching relative to the ground plane: a narrow search where plain matching needs a wide one.

On ground seen at a slant disparity runs over a hundred pixels from the bottom row to the horizon;
relative to the ground plane it runs over the height of the rocks (Burt, Wixson and Salgian 1995).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.rectification.estimate import (
    Rectification,
    estimate_rectification,
)
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.semi_global import (
    SUBPIXELS,
    Penalties,
    disparity_range,
    semi_global_match,
)

# How many times what chance would explain a lens must explain, at first and once it was matched
# with. Where it bends most there is no match until it is nearly straightened: then a true one
# explains more, a false one less. On some four hundred rendered pairs straight lenses came to 27
# at most, and those over 12 then to 21.
_LENS_GAIN_AT_FIRST = 12.0
_LENS_GAIN = 30.0
_LENS_PASSES = 8
_LENS_MOVED_PX = 0.25
# Less costs more by resampling than it saves.
_LEAST_BEND_PX = 0.2
_TAIL = 0.002
_MARGIN_PX = 5.0
_MIN_COARSE_WIDTH = 160


@dataclass(frozen=True)
class CoarseDisparity:
    """Disparity at a fraction of the resolution, in pixels of that fraction, and its camera.

    Of the image that straight lenses would show. With it comes what is left of the rectification,
    in pixels of the full image.
    """

    disparity: NDArray[np.float32]
    camera: StereoCamera
    reduction: float
    alignment: RowAlignment
    lenses: Lenses = STRAIGHT_LENSES


def coarse_disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    camera: StereoCamera,
    config: DetectorConfig,
    penalty: Penalties,
    reduction: int,
    *,
    lenses: bool = True,
) -> CoarseDisparity:
    """Match the pair over the camera's whole range, at about ``1 / reduction`` of its size.

    Parameters
    ----------
    left, right : ndarray of uint8, shape (height, width)
    camera : StereoCamera
    config : DetectorConfig
    penalty : Penalties
    reduction : int
        Small images are reduced less.
    lenses : bool
        Whether to straighten lenses that still bend.
    """
    # SGBM draws disparities to whole pixels: of two or three pixels little would be left.
    reduction = max(1, min(reduction, camera.width // _MIN_COARSE_WIDTH))
    size = camera.width // reduction, max(1, camera.height // reduction)
    small = camera.resized(*size)
    lowest = math.floor(config.min_disparity * size[0] / camera.width)
    count = config.disparity_range or disparity_range(camera, config.min_range)
    count = max(16, math.ceil(count * size[0] / camera.width / 16) * 16)
    small_left, small_right = (
        np.asarray(cv2.resize(eye, size, interpolation=cv2.INTER_AREA), np.uint8)
        for eye in (left, right)
    )
    scale = camera.width / size[0]

    def match(pair: GreyPair, alignment: RowAlignment) -> NDArray[np.float32]:
        # The search covers a large part of the width: a left border without matches would be wide.
        return warped_disparity(
            *pair,
            small,
            np.zeros(small.shape, np.float32),
            (lowest, count),
            config,
            penalty,
            alignment.reduced(scale),
        )

    pair = small_left, small_right
    disparity = match(pair, STRAIGHT)
    found = estimate_rectification(pair, disparity, small, scale, bent=lenses)
    if found.gain > _LENS_GAIN_AT_FIRST:
        straightened = _with_straight_lenses(pair, found, small, scale, match)
        if straightened is not None:
            return straightened
    turned = found.alignment.added_disparity(small) * (disparity > 0)
    return CoarseDisparity(np.maximum(disparity - turned, 0), small, scale, found.alignment)


def _with_straight_lenses(
    pair: GreyPair,
    found: Rectification,
    camera: StereoCamera,
    reduction: float,
    match: Callable[[GreyPair, RowAlignment], NDArray[np.float32]],
) -> CoarseDisparity | None:
    """Match what straight lenses should have shown and measure the lenses again, in turn.

    Returns
    -------
    CoarseDisparity or None
        None where the lenses turn out to be straight, or nearly so.
    """
    for number in range(_LENS_PASSES):
        straight = found.lenses.straightened(pair, camera)
        disparity = match(straight, found.alignment)
        disparity[found.lenses.unseen(disparity, camera)] = 0
        if (number and found.moved_px < _LENS_MOVED_PX) or number == _LENS_PASSES - 1:
            break
        found = estimate_rectification(
            straight, disparity, camera, reduction, found.alignment, found.lenses
        )
        if found.gain < _LENS_GAIN:
            return None
    if found.lenses.mean_bend_px(camera) * reduction < _LEAST_BEND_PX:
        return None
    return CoarseDisparity(disparity, camera, reduction, found.alignment, found.lenses)


def residual_range(coarse: CoarseDisparity, plane: DisparityPlane) -> tuple[int, int]:
    """Lowest residual and number of residuals (a multiple of 16) that the scene needs, pixels.

    Parameters
    ----------
    coarse : CoarseDisparity
    plane : DisparityPlane
        In coarse pixels.
    """
    expected = plane.disparity(coarse.camera)
    # What stands out over the horizon stands below it too; in a bare sky all matches are false.
    below_horizon = (coarse.disparity > 0) & (expected > 0)
    residual = (coarse.disparity - expected)[below_horizon]
    if not residual.size:
        return -8, 16
    # Matched at x - r, where a plane that tilts has less: it takes more to come to the residual.
    residual /= min(max(1 - plane.slope_u, 0.5), 1.0)
    low, high = np.quantile(residual, (_TAIL, 1 - _TAIL)) * coarse.reduction
    # A pair that does not belong together has residuals without end: nothing would come of them.
    widest = coarse.camera.width * coarse.reduction / 2
    low, high = max(low, -widest), min(high, widest)
    lowest = math.floor(min(low, 0.0) - _MARGIN_PX)
    count = math.ceil((max(high, 0.0) + _MARGIN_PX - lowest) / 16) * 16
    return lowest, max(count, 16)


def warped_disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    camera: StereoCamera,
    expected: NDArray[np.float32],
    search: tuple[int, int],
    config: DetectorConfig,
    penalty: Penalties,
    alignment: RowAlignment = STRAIGHT,
) -> NDArray[np.float32]:
    """Match the left image with the right one warped by the expected disparity.

    Parameters
    ----------
    left, right : ndarray of uint8, shape (height, width)
    camera : StereoCamera
    expected : ndarray of float32, shape (height, width)
        Disparity of the ground plane, the camera's offset taken off, not below 0.
    search : tuple of int
        Lowest residual and how many, pixels.
    config : DetectorConfig
    penalty : Penalties
    alignment : RowAlignment
        Rows by which the right image is off.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Disparity, pixels, the camera's offset taken off; 0 where there is no match or the match
        would lie outside the right image.
    """
    lowest, count = search
    highest = lowest + count - 1
    before, after = max(highest, 0), max(-lowest, 0)
    wide_left = cv2.copyMakeBorder(left, 0, 0, before, after, cv2.BORDER_REPLICATE)
    columns = np.arange(-before, camera.width + after, dtype=np.float32)
    # The border continues the plane; what it shows is the right image where there is one.
    wide_expected = cv2.copyMakeBorder(expected, 0, 0, before, after, cv2.BORDER_REPLICATE)
    source_columns = columns[np.newaxis] - wide_expected - np.float32(camera.disparity_offset)
    source_columns -= alignment.added_disparity(camera)
    source_rows = alignment.rows(camera, columns)
    wide_right = cv2.remap(
        right,
        source_columns,
        source_rows,
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    fixed = semi_global_match(
        np.asarray(wide_left, np.uint8), np.asarray(wide_right, np.uint8),
        lowest, count, config, penalty,
    )[:, before : before + camera.width]  # fmt: skip
    disparity = fixed.astype(np.float32)
    disparity *= np.float32(1 / SUBPIXELS)
    # Matched at x - r, the warp moved that pixel by the disparity expected there, not at x.
    disparity += expected - disparity * np.gradient(expected, axis=1)
    seen_right = np.arange(camera.width, dtype=np.float32)[np.newaxis] - disparity
    seen_right -= np.float32(camera.disparity_offset)
    disparity[
        (fixed < lowest * SUBPIXELS) | (disparity <= 0)
        | (seen_right < config.block_size) | (seen_right > camera.width - 1)
    ] = 0  # fmt: skip
    return disparity
