"""What the network sees: evidence for an obstacle at each pixel, on one scale."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.rocks.parallax import STEP_SHARES, parallax_evidence
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.standing import Standing
from rover_obstacle_detection.detection.rocks.windows import Window
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
    measured = terrain.measured[window]
    parts = standing.parts[window]
    step_m = np.float32(parameters.max_step_m)
    on_part = (parts > 0).astype(np.float32)
    top_m = standing.top_m[parts]
    height_m = np.nan_to_num(terrain.height_m[window], nan=0.0)
    max_noise_m = np.float32(_UNKNOWN_NOISE_STEPS * parameters.max_step_m)
    noise_m = np.minimum(terrain.noise_m[window], max_noise_m)
    step_px = terrain.pixels_per_metre[window] * step_m
    noise_px = stereo.noise_px[window].copy()
    on_part_around = on_part.copy()
    _fill_from_lower_side(
        measured, height_m, (height_m, noise_m, step_px, noise_px, on_part_around, top_m)
    )
    kernel = np.ones((_TOP_REACH_PX, _TOP_REACH_PX), np.uint8)
    evidence = parallax_evidence(stereo, terrain, parameters.max_step_m, window)
    features = np.empty((len(FEATURES), *measured.shape), np.float32)
    for feature, values in zip(
        features,
        (
            np.clip(height_m / step_m, -2, 6),
            np.clip(height_m / np.maximum(noise_m, np.float32(0.005)), -4, 12) / 4,
            measured,
            np.minimum(noise_m / step_m, 2),
            noise_px * 5,
            np.log(np.clip(step_px, 0.5, 500)) / 3,
            grey_against_ground(stereo.frame.pair[0][window], on_part, stereo.texture),
            on_part_around,
            np.clip(cv2.dilate(top_m, kernel) / step_m, 0, 5),
            *np.clip(np.copysign(np.sqrt(np.abs(evidence)), evidence), -6, 6) / 2,
        ),
        strict=True,
    ):
        feature[:] = values
    return features


def _fill_from_lower_side(
    measured: NDArray[np.bool_], height_m: Image, images: tuple[Image, ...]
) -> None:
    """Give unmeasured pixels the values of the nearest measured one on their row, in place."""
    rows, columns = np.nonzero(~measured)
    left, right = measured_neighbours(measured, rows, columns)
    source = np.where(height_m[rows, left] > height_m[rows, right], right, left)
    for image in images:
        image[rows, columns] = image[rows, source]


def measured_neighbours(
    measured: NDArray[np.bool_], rows: NDArray[np.intp], columns: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the nearest measured pixel on either side of a pixel, on its row.

    Parameters
    ----------
    measured : ndarray of bool, shape (height, width)
    rows, columns : ndarray of int, shape (n,)
        Pixels that are not measured.

    Returns
    -------
    left, right : ndarray of int, shape (n,)
        Columns. Where one side has none, that of the other side; where neither has, the pixel's
        own.
    """
    height, width = measured.shape
    places = np.flatnonzero(measured)
    # A sentinel at either end gives every search an answer, possibly on another row.
    places = np.concatenate(([-1], places, [height * width]))
    after = np.searchsorted(places, rows * width + columns)
    left, right = places[after - 1], places[after]
    no_left, no_right = left < rows * width, right >= (rows + 1) * width
    left, right = left - rows * width, right - rows * width
    left = np.where(no_left, np.where(no_right, columns, right), left)
    right = np.where(no_right, left, right)
    return left, right


def grey_against_ground(grey: NDArray[np.uint8], on_part: Image, texture: float) -> Image:
    """Compare each pixel with the mean of the ground around it, in units of the texture."""
    image = grey.astype(np.float32)
    ground = 1 - on_part
    size = (_GROUND_WINDOW_PX, _GROUND_WINDOW_PX)
    share = cv2.blur(ground, size)
    mean = cv2.blur(image * ground, size) / np.maximum(share, np.float32(1e-3))
    difference = np.where(share > 0.02, image - mean, 0)
    return np.asarray(np.clip(difference / np.float32(4 * texture), -3, 3), np.float32)
