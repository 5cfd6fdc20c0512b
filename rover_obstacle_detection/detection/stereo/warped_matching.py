"""Matching relative to the ground plane: a narrow search instead of a wide one.

On ground seen at a slant, disparity runs over a hundred pixels from the bottom row to the horizon.
Relative to the ground plane it runs only over the height of the rocks (Burt, Wixson and Salgian
1995).
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane
from rover_obstacle_detection.detection.geometry.robust import quantile
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.strips import Strip, in_strips
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.empty_matches import remove_empty_matches
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.semi_global import (
    SUBPIXELS,
    Penalties,
    semi_global_match,
)


def residual_range(
    coarse: NDArray[np.float32],
    camera: StereoCamera,
    reduction: float,
    plane: DisparityPlane,
    parameters: StereoParameters,
) -> tuple[int, int]:
    """Choose the search so that it reaches everything that the coarse match shows.

    Parameters
    ----------
    coarse : ndarray of float32, shape (height, width)
        Coarse disparity in its own pixels; 0 where there is no match.
    camera : StereoCamera
        Of the coarse disparity.
    reduction : float
        Full-size pixels in one of these.
    plane : DisparityPlane
        The ground, in coarse pixels.
    parameters : StereoParameters

    Returns
    -------
    tuple of int
        First residual and their number, a multiple of 16, in full-size pixels.
    """
    expected = plane.disparity(camera)
    # Objects above the horizon also extend below it, and matches in the sky are false.
    below_horizon = (coarse > 0) & (expected > 0)
    residual = (coarse - expected)[below_horizon]
    if not residual.size:
        return -8, 16
    # A match at x - r meets a tilted plane where it has less disparity, so it takes a larger r.
    residual /= min(max(1 - plane.slope_u, 0.5), 1.0)
    tail = parameters.tail_share
    low, high = (quantile(residual, each) * reduction for each in (tail, 1 - tail))
    # Images that do not belong together have residuals of any size.
    widest = camera.width * reduction / 2
    low, high = max(low, -widest), min(high, widest)
    margin = parameters.search_margin_px
    lowest = math.floor(min(low, 0.0) - margin)
    count = math.ceil((max(high, 0.0) + margin - lowest) / 16) * 16
    return lowest, max(count, 16)


def warped_disparity(
    pair: GreyPair,
    camera: StereoCamera,
    expected: NDArray[np.float32],
    search: tuple[int, int],
    penalties: Penalties,
    parameters: StereoParameters,
    rows: RowAlignment = STRAIGHT,
) -> NDArray[np.float32]:
    """Match the left image with the right image warped by the expected disparity.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    camera : StereoCamera
    expected : ndarray of float32, shape (height, width)
        Disparity of the ground plane, without the camera's offset, not below 0.
    search : tuple of int
        First residual and their number, pixels.
    penalties : Penalties
    parameters : StereoParameters
    rows : RowAlignment
        Rows by which the right image is off.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Disparity in pixels, without the camera's offset; 0 where there is no match, it would lie
        outside the right image, or rectification left either image empty.
    """
    lowest, count = search
    highest = lowest + count - 1
    before, after = max(highest, 0), max(-lowest, 0)
    wide_left = cv2.copyMakeBorder(pair[0], 0, 0, before, after, cv2.BORDER_REPLICATE)
    # The border continues the plane, so that it shows the right image where there is one.
    wide_expected = cv2.copyMakeBorder(expected, 0, 0, before, after, cv2.BORDER_REPLICATE)
    places = rows.places(np.asarray(wide_expected), camera, first_column=-before)
    wide_right = cv2.remap(pair[1], *places, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    fixed = semi_global_match(
        np.asarray(wide_left, np.uint8),
        np.asarray(wide_right, np.uint8),
        search,
        penalties,
        parameters,
    )[:, before : before + camera.width]
    disparity = np.empty(camera.shape, np.float32)
    right_column = np.arange(camera.width, dtype=np.float32) - np.float32(camera.disparity_offset)
    # Where the match lies outside the right image.
    most, least = right_column - parameters.block_size_px, right_column - (camera.width - 1)
    np.maximum(least, np.float32(0), out=least)

    def measure(strip: Strip) -> None:
        residual = fixed[strip.rows].astype(np.float32)
        residual *= np.float32(1 / SUBPIXELS)
        # The match lies at x - r, and the warp moved that pixel by the disparity expected there.
        total = residual * np.gradient(expected[strip.rows], axis=1)
        np.subtract(residual, total, out=total)
        total += expected[strip.rows]
        matched = (residual >= lowest) & (total > 0)
        matched &= (total <= most) & (total >= least)
        np.multiply(total, matched, out=disparity[strip.rows])

    in_strips(measure, camera.height)
    remove_empty_matches(disparity, pair, camera, parameters, rows, expected <= 0)
    return disparity
