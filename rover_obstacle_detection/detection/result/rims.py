"""Rims of obstacles: pixels that carry the distance of what lies beside them."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.network.tiles import tiles_around
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.parameters import ResultParameters

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

STANDING = np.uint8(Cue.HEIGHT | Cue.GREY_LEVEL)
"""Cues of what stands on the ground and can hide the ground behind it."""


class Rims(NamedTuple):
    """Pixels beside the outline of an obstacle with the distance of the other side.

    Parameters
    ----------
    behind : ndarray of bool, shape (height, width)
        Pixels of obstacles that carry the distance of the ground behind.
    before : ndarray of bool, shape (height, width)
        Free pixels that carry the distance of an obstacle.
    """

    behind: Mask
    before: Mask


def find_rims(
    disparity: Image,
    height_m: Image,
    height_noise_m: Image,
    cues: NDArray[np.uint8],
    numbers: NDArray[np.int32],
    camera: StereoCamera,
    camera_height_m: float,
    parameters: ResultParameters,
) -> Rims:
    """Find the pixels at the rims of obstacles that were matched to the wrong side.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    height_m, height_noise_m : ndarray of float32, shape (height, width)
        Height above the local ground and its standard deviation, metres; NaN and infinite where
        there is no 3D.
    cues : ndarray of uint8, shape (height, width)
    numbers : ndarray of int32, shape (height, width)
        Number of each pixel's obstacle; 0 where there is none.
    camera : StereoCamera
    camera_height_m : float
        Above the ground plane, metres.
    parameters : ResultParameters

    Notes
    -----
    Matching smears depth across the outline of an obstacle by a few pixels. The body of an
    obstacle is what is nearly as high as its surroundings. A pixel of the obstacle is at a rim if
    it is low like ground and lies clearly behind all of the body around it. The foot of a rock is
    low as well, but no farther away than the body; the foot of a farther rock in the same outline
    is no farther away than that rock's body. A free pixel is at a rim if it is high like an
    obstacle and does not lie clearly behind the body around it.
    """
    rims = Rims(np.zeros(cues.shape, np.bool_), np.zeros(cues.shape, np.bool_))
    standing = (numbers > 0) & (cues > 0) & (cues & ~STANDING == 0)
    scale = np.float32(camera.fx * camera.baseline_m)
    for tile in tiles_around(standing):
        # A pixel beside an obstacle needs what is as far again from the tile.
        window, near = tile.outer, tile.grown(parameters.rim_reach_px)
        with np.errstate(divide='ignore', invalid='ignore'):
            depth_m = scale / disparity[window]
            # Both have the noise of disparity; over plain ground, this is their ratio.
            noise_m = depth_m * height_noise_m[window] / np.float32(camera_height_m)
        behind, before = _rims_within(
            depth_m,
            noise_m,
            height_m[window],
            standing[window],
            numbers[window] == 0,
            parameters,
        )
        rims.behind[tile.inner] = behind[tile.in_outer(tile.inner)]
        rims.before[near] |= before[tile.in_outer(near)]
    if rims.behind.any():
        measured = standing & np.isfinite(height_m)
        rims.behind[_without_body(rims.behind, measured, numbers)] = False
    return rims


def _rims_within(
    depth_m: Image,
    noise_m: Image,
    height_m: Image,
    standing: Mask,
    free: Mask,
    parameters: ResultParameters,
) -> Rims:
    p = parameters
    kernel = np.ones((2 * p.rim_reach_px + 1,) * 2, np.uint8)
    low_m = np.float32(p.rim_share * p.max_step_m)
    # Comparisons with NaN are false.
    above_m = np.where(standing & (height_m > 0), height_m, np.float32(0))
    least_m = np.maximum(cv2.dilate(above_m, kernel) * np.float32(p.rim_share), low_m)
    body_m = np.where(above_m >= least_m, depth_m, np.float32(0))
    farthest_m = np.asarray(cv2.dilate(body_m, kernel), np.float32)
    gap_m = np.maximum(noise_m * np.float32(p.rim_noises), np.float32(p.rim_gap_m))
    beside = farthest_m > 0
    clearly_behind = depth_m > farthest_m + gap_m
    behind = standing & beside & clearly_behind & (height_m < least_m)
    before = free & beside & ~clearly_behind & (height_m >= low_m)
    return Rims(np.asarray(behind), np.asarray(before))


def _without_body(behind: Mask, measured: Mask, numbers: NDArray[np.int32]) -> Mask:
    """Mark the rims that are all the 3D of an obstacle: it is a small one beside another."""
    count = np.bincount(numbers[behind])
    own = np.bincount(numbers[measured], minlength=len(count))[: len(count)]
    alone = np.zeros_like(behind)
    alone[behind] = (count == own)[numbers[behind]]
    return alone
