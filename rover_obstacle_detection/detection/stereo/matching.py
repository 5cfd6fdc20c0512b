"""From a straightened pair and its ground plane to disparity with noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.texture import untextured
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.semi_global import Penalties, chosen_penalties
from rover_obstacle_detection.detection.stereo.warped_matching import warped_disparity

Image = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Stereo:
    """What matching found in one frame.

    Parameters
    ----------
    frame : Frame
        The images that were matched.
    ground : GroundPlane
    expected : ndarray of float32, shape (height, width)
        Disparity of the ground plane, pixels; below 0 above the horizon.
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    noise_px : ndarray of float32, shape (height, width)
        Standard deviation of the disparity.
    grey_noise : float
        Standard deviation of the grey-level difference between matched pixels of both images.
    texture : float
        Spread of the left image's grey level within a few pixels.
    rows : RowAlignment
        Rows by which the right image is off.
    """

    frame: Frame
    ground: GroundPlane
    expected: Image
    disparity: Image
    noise_px: Image
    grey_noise: float
    texture: float
    rows: RowAlignment = STRAIGHT


def match_against_ground(
    frame: Frame,
    even: GreyPair,
    ground: GroundPlane,
    search: tuple[int, int],
    penalties: Penalties,
    correction: Correction,
    parameters: StereoParameters,
) -> tuple[Image, Image]:
    """Match relative to the ground plane.

    Parameters
    ----------
    frame : Frame
        Straightened by the correction.
    even : tuple of two ndarray of uint8, shape (height, width)
        Its images with even contrast: see `with_even_contrast`.
    ground : GroundPlane
    search : tuple of int
        First residual and their number, pixels.
    penalties : Penalties
    correction : Correction
    parameters : StereoParameters

    Returns
    -------
    expected : ndarray of float32, shape (height, width)
        Disparity of the ground plane, pixels; below 0 above the horizon.
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    """
    camera = frame.camera
    expected = DisparityPlane.from_ground(ground, camera).disparity(camera)
    disparity = warped_disparity(
        even, camera, np.maximum(expected, 0), search, penalties, parameters, correction.rows
    )
    sky = expected <= 0
    if sky.any():
        # SGBM fills untextured areas from their surroundings, which is wrong there.
        sky &= untextured(frame.pair[0], parameters.sky_window_px, parameters.sky_texture)
        disparity[sky] = 0
    if frame.excluded is not None:
        disparity[frame.excluded] = 0
    unseen = correction.unseen(disparity, camera)
    if unseen is not None:
        disparity[unseen] = 0
    median = np.asarray(cv2.medianBlur(disparity, 3), np.float32)
    median *= disparity > 0
    return expected, median


def image_penalties(
    gradient: float, noise_share: float, parameters: StereoParameters
) -> Penalties:
    """Choose SGBM's penalties by the contrast of the image, unless the user set them.

    The cost of a false match grows with the grey level's gradient and the size of the block. A
    penalty must keep pace, or hazy images are over-smoothed and crisp ones fragmented. Where noise
    hides the texture, costs say less and smoothness must count more.

    Parameters
    ----------
    gradient : float
        Typical gradient of the left image, grey levels per pixel.
    noise_share : float
        How far noise hides the texture, 0 to 1.
    parameters : StereoParameters
    """
    unit = gradient * parameters.block_size_px**2
    unit *= parameters.smoothness * (1 + parameters.noise_penalty * noise_share)
    step, jump = round(parameters.step_penalty * unit), round(parameters.jump_penalty * unit)
    return chosen_penalties(parameters, Penalties(max(1, step), jump))
