"""Matches with what rectification left empty."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.empty_border import empty_border
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.strips import Strip, in_strips
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters


def remove_empty_matches(
    disparity: NDArray[np.float32],
    pair: GreyPair,
    camera: StereoCamera,
    parameters: StereoParameters,
    rows: RowAlignment = STRAIGHT,
    sky: NDArray[np.bool_] | None = None,
) -> None:
    """Set the disparity to 0 in and beside the empty border of either image.

    The edge of the border lies in both images and looks like a match.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match. Changed in place.
    pair : tuple of two ndarray of uint8, shape (height, width)
    camera : StereoCamera
    parameters : StereoParameters
    rows : RowAlignment
        Rows by which the right image is off.
    sky : ndarray of bool, shape (height, width), optional
        Where black may be the sky behind a narrow object. Matches beside it stay there.
    """
    left, right = (_empty(image, parameters) for image in pair)
    beside = np.zeros(disparity.shape, np.bool_) if sky is None else sky
    if left is not None:
        disparity[left > beside] = 0
    if right is None:
        return
    empty = right

    def remove(strip: Strip) -> None:
        part = disparity[strip.rows]
        places = rows.places(part, camera, strip.rows.start)
        # What lies beyond a border is empty as well.
        landed = cv2.remap(empty, *places, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
        part *= landed <= beside[strip.rows]

    in_strips(remove, camera.height)


def _empty(image: NDArray[np.uint8], parameters: StereoParameters) -> NDArray[np.uint8] | None:
    """2 in the empty border and on its rim, 1 beside it within the reach of matching."""
    border = empty_border(image, parameters.empty_block_px, parameters.empty_rim_px)
    if border is None:
        return None
    reach_px = parameters.match_reach_px - parameters.empty_rim_px
    kernel = np.ones((2 * reach_px + 1,) * 2, np.uint8)
    return np.asarray(border + cv2.dilate(border.view(np.uint8), kernel), np.uint8)
