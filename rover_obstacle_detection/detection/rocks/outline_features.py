"""What the network sees: evidence for an obstacle at each pixel, on one scale."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.components import runs
from rover_obstacle_detection.detection.network.tiles import Window
from rover_obstacle_detection.detection.rocks.parallax import STEP_SHARES, parallax_evidence
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.standing import Standing
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.terrain import Terrain

Image = NDArray[np.float32]

FEATURES = (
    'height over the step',
    'height over its noise',
    'measured',
    'noise over the step',
    'disparity noise',
    'scale',
    'grey level against the ground',
    'standing part',
    'top of the part over the step',
    'parallax evidence',
    *(f'parallax evidence for {share:g} steps' for share in STEP_SHARES),
)
"""Names of the feature planes, in order."""

FEATURES_VERSION = '1'
"""Version of their definition, constants included: a model is trained for one of them."""

PARALLAX_FEATURES = tuple(
    number for number, name in enumerate(FEATURES) if name.startswith('parallax evidence')
)
"""Numbers of the planes that `parallax_evidence` fills."""

EVERYWHERE = (slice(None), slice(None))
"""The window that is the whole image."""

# Part of the definition of the features, as are the scales below.
_GROUND_WINDOW_PX = 61
_TOP_REACH_PX = 15
_UNKNOWN_NOISE_STEPS = 3.0


def outline_features(
    stereo: Stereo,
    terrain: Terrain,
    standing: Standing,
    window: Window,
    parameters: RockParameters,
) -> Image:
    """Bring what 3D and the image show of each pixel to one scale.

    Lengths are relative to the rover's step and grey levels to the image's own texture, so that
    neither the size of the rover nor the light matters.

    Parameters
    ----------
    stereo : Stereo
    terrain : Terrain
    standing : Standing
    window : tuple of two slices
        Rows and columns to look at.
    parameters : RockParameters

    Returns
    -------
    ndarray of float32, shape (features, rows, columns)
        In the order of `FEATURES`.

    Notes
    -----
    Pixels without 3D take the values of the nearest measured pixel on their row, on the side that
    is lower: what a rock hides from the right image lies behind the rock.
    """
    near, parts = terrain.within(window), standing.parts[window]
    step_m = np.float32(parameters.max_step_m)
    height_m = np.where(near.measured, near.height_m, 0)
    noise_m = np.minimum(near.noise_m, np.float32(_UNKNOWN_NOISE_STEPS * parameters.max_step_m))
    step_px = near.pixels_per_metre * step_m
    noise_px = stereo.noise_px[window].copy()
    on_part = (parts > 0).astype(np.float32)
    top_m = standing.top_m.take(parts)
    features = np.empty((len(FEATURES), *parts.shape), np.float32)
    over_step, over_noise, measured, noise, disparity_noise, scale, grey, part, top = features[:9]
    measured[:] = near.measured
    grey[:] = grey_against_ground(stereo.frame.pair[0][window], on_part, stereo.texture)
    fill_from_lower_side(
        near.measured, height_m, (height_m, noise_m, step_px, noise_px, on_part, top_m)
    )
    np.clip(np.divide(height_m, step_m, out=over_step), -2, 6, out=over_step)
    np.divide(height_m, np.maximum(noise_m, np.float32(0.005)), out=over_noise)
    np.clip(over_noise, -4, 12, out=over_noise)
    over_noise /= 4
    np.minimum(np.divide(noise_m, step_m, out=noise), 2, out=noise)
    np.multiply(noise_px, 5, out=disparity_noise)
    np.log(np.clip(step_px, 0.5, 500, out=step_px), out=scale)
    scale /= 3
    part[:] = on_part
    kernel = np.ones((_TOP_REACH_PX, _TOP_REACH_PX), np.uint8)
    np.clip(np.divide(cv2.dilate(top_m, kernel), step_m, out=top), 0, 5, out=top)
    evidence = parallax_evidence(stereo, terrain, parameters.max_step_m, window)
    for feature, each in zip(features[9:], evidence, strict=True):
        np.sqrt(np.abs(each, out=feature), out=feature)
        np.copysign(np.minimum(feature, 6, out=feature), each, out=feature)
        feature /= 2
    return features


def fill_from_lower_side(
    measured: NDArray[np.bool_], height_m: Image, images: tuple[Image, ...]
) -> None:
    """Give unmeasured pixels the values of the nearest measured one on their row, in place.

    Parameters
    ----------
    measured : ndarray of bool, shape (height, width)
    height_m : ndarray of float32, shape (height, width)
        Of the measured pixels on both sides of a gap, the lower one counts.
    images : tuple of ndarray of float32, shape (height, width)
        Filled in. Rows without a measured pixel are left as they are.
    """
    width = measured.shape[1]
    missing = ~measured & measured.any(axis=1, keepdims=True)
    first, last = runs(missing)
    left = np.where(first % width > 0, first - 1, last + 1)
    right = np.where(last % width < width - 1, last + 1, first - 1)
    heights = height_m.ravel()
    source = np.where(heights[left] > heights[right], right, left)
    for image in images:
        image[missing] = np.repeat(image.ravel()[source], last - first + 1)


def grey_against_ground(grey: NDArray[np.uint8], on_part: Image, texture: float) -> Image:
    """Compare each pixel with the mean of the ground around it, in units of the texture."""
    # Sums of whole numbers are fast and exact.
    ground = (on_part == 0).view(np.uint8)
    size = (_GROUND_WINDOW_PX, _GROUND_WINDOW_PX)
    share = cv2.boxFilter(ground, cv2.CV_32F, size)
    mean = cv2.boxFilter(grey * ground, cv2.CV_32F, size)
    mean /= np.maximum(share, np.float32(1e-3))
    difference = np.subtract(grey, mean, out=mean)
    difference[share <= 0.02] = 0
    difference /= np.float32(4 * texture)
    return np.asarray(np.clip(difference, -3, 3, out=difference), np.float32)
