"""From a grey pair to disparity over the ground plane, with its noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.noise import DISPARITY_NOISE_PX
from rover_obstacle_detection.detection.geometry.plane_fit import estimate_ground
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.image_noise import (
    gradient_level,
    noise_share,
    smoothed_against_noise,
)
from rover_obstacle_detection.detection.images.texture import texture_level, untextured
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.stereo.semi_global import MAX_PENALTY, Penalties, penalties
from rover_obstacle_detection.detection.stereo.subpixel import refine_disparity
from rover_obstacle_detection.detection.stereo.warped_matching import (
    coarse_disparity,
    residual_range,
    warped_disparity,
)

COARSE_REDUCTION = 4
COARSE_PENALTIES = Penalties(one=300, more=1200)
# Per pixel of the matching block and grey level of gradient, and how much more in pure noise.
PENALTY_ONE = 5.0
PENALTY_MORE = 20.0
NOISE_PENALTY = 3.0

MIN_TEXTURE = 2.0
TEXTURE_WINDOW = 9


@dataclass(frozen=True, eq=False)
class Stereo:
    """What matching found.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
        Grey, smoothed where noise drowns texture, straightened where lenses bend.
    ground : GroundPlane
    expected : ndarray of float32, shape (height, width)
        Disparity of the ground plane, pixels; below 0 above the horizon.
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    noise_px : ndarray of float32, shape (height, width)
        Its standard deviation.
    alignment : RowAlignment
        Rows by which the right image is off.
    grey_noise : float
        Standard deviation of the grey level between both images where they match.
    texture : float
        Spread of the left image's grey level within a few pixels.
    lenses : Lenses
        By which both images were straightened: all else here is of what straight lenses show.
    seen : ndarray of uint8, shape (height, width), optional
        The left image before it was straightened, if it was.
    rover_mask : ndarray of bool, shape (height, width), optional
        Straightened as the left image is.
    """

    pair: GreyPair
    ground: GroundPlane
    expected: NDArray[np.float32]
    disparity: NDArray[np.float32]
    noise_px: NDArray[np.float32]
    alignment: RowAlignment
    grey_noise: float
    texture: float
    lenses: Lenses = STRAIGHT_LENSES
    seen: NDArray[np.uint8] | None = None
    rover_mask: NDArray[np.bool_] | None = None


def match_against_ground(
    pair: GreyPair,
    camera: StereoCamera,
    config: DetectorConfig,
    gravity: Gravity | None,
    rover_mask: NDArray[np.bool_] | None,
    finished: Callable[[str], None],
    leave_out: frozenset[str] = frozenset(),
) -> Stereo:
    """Find the ground plane at a quarter of the resolution, then match relative to it.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    camera : StereoCamera
    config : DetectorConfig
    gravity : Gravity, optional
        The vertical, where known.
    rover_mask : ndarray of bool, shape (height, width), optional
        Pixels that show the rover: without 3D.
    finished : callable
        Told the name of each stage as it ends.
    leave_out : frozenset of str
        Stages to do without.
    """
    share = 0.0 if 'noise' in leave_out else noise_share(pair[0])
    pair = smoothed_against_noise(pair, share)
    finished('noise')
    coarse = coarse_disparity(
        *pair,
        camera,
        config,
        penalties(config, COARSE_PENALTIES),
        COARSE_REDUCTION,
        lenses=not leave_out & {'rows', 'lenses'},
    )
    alignment = STRAIGHT if 'rows' in leave_out else coarse.alignment
    seen = pair[0]
    pair = coarse.lenses.straightened(pair, camera)
    rover_mask = coarse.lenses.straightened_mask(rover_mask, camera)
    if rover_mask is not None:
        coarse.disparity[_reduced(rover_mask, coarse.disparity.shape)] = 0
    finished('coarse disparity')
    ground = estimate_ground(coarse.disparity, coarse.camera, config, gravity)
    finished('ground plane')
    expected = DisparityPlane.from_ground(ground, camera).disparity(camera)
    search = residual_range(coarse, DisparityPlane.from_ground(ground, coarse.camera))
    disparity = warped_disparity(
        *pair,
        camera,
        np.maximum(expected, 0),
        search,
        config,
        penalties(config, image_penalties(pair[0], share, config)),
        alignment,
    )
    # A bare sky takes the disparity of the hills before it; on the ground that is a fair guess.
    disparity[(expected <= 0) & untextured(pair[0], TEXTURE_WINDOW, MIN_TEXTURE)] = 0
    if rover_mask is not None:
        disparity[rover_mask] = 0
    if coarse.lenses:
        disparity[coarse.lenses.unseen(disparity, camera)] = 0
    matched = disparity > 0
    disparity = np.where(matched, cv2.medianBlur(disparity, 3), 0).astype(np.float32)
    finished('disparity')
    refined = refine_disparity(*pair, disparity, camera, alignment)
    if 'subpixel' in leave_out:
        noise_px = np.full_like(disparity, DISPARITY_NOISE_PX / 2)
        refined = replace(refined, disparity=disparity, noise_px=noise_px)
    finished('subpixel')
    return Stereo(
        pair,
        ground,
        expected,
        refined.disparity,
        refined.noise_px,
        alignment,
        refined.grey_noise,
        texture_level(pair[0]),
        coarse.lenses,
        seen if coarse.lenses.left else None,
        rover_mask,
    )


def image_penalties(grey: NDArray[np.uint8], share: float, config: DetectorConfig) -> Penalties:
    """Choose SGBM's penalties by the contrast of the image.

    The cost of a false match grows with the grey level's gradient and the pixels of the block; a
    penalty has to keep step with it, or a hazy image comes out flat and a crisp one torn. Where
    noise drowns texture, costs tell less and smoothness has to tell more.
    """
    unit = gradient_level(grey) * config.block_size**2
    unit *= config.smoothness * (1 + NOISE_PENALTY * share)
    one = min(max(1, round(PENALTY_ONE * unit)), MAX_PENALTY - 1)
    return Penalties(one, min(max(round(PENALTY_MORE * unit), one + 1), MAX_PENALTY))


def _reduced(mask: NDArray[np.bool_], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    small = cv2.resize(mask.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(small > 0.5)
