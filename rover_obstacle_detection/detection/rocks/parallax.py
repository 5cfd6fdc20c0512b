"""Does a pixel stand up? The right image's own word, pixel by pixel."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.stereo.ground_matching import Stereo
from rover_obstacle_detection.detection.terrain.survey import Terrain

Image = NDArray[np.float32]

STEP_SHARES = (0.5, 1.0, 2.0)
"""Heights over the rover's step at which a pixel is tried, whatever was matched."""

_BRIGHTNESS_WINDOW = 41
_WINDOW = 3
_LEAST_NOISE = 1.0
# Of the eye's height over the plane: what stands nearly as high as the eye hides ground far away,
# and ground in line with the eye hides none.
_LEAST_BELOW_EYE = 0.05


def parallax_evidence(
    stereo: Stereo,
    terrain: Terrain,
    camera: StereoCamera,
    max_step_m: float,
    window: tuple[slice, slice],
) -> Image:
    """Compare how well the right image fits the ground, and what stands up from it.

    Parameters
    ----------
    stereo : Stereo
    terrain : Terrain
    camera : StereoCamera
    max_step_m : float
        The rover's step.
    window : tuple of two slices
        Rows and columns to look at.

    Returns
    -------
    ndarray of float32, shape (1 + len(STEP_SHARES), rows, columns)
        By how much more the squared grey levels differ if the pixel lay on the local ground, over
        the image's noise, than if it lay where it was matched, and than at each share of the step
        over the ground: positive where the pair says that it stands up, negative where the
        disparity of something near has spread over ground; 0 without 3D, for what stands as high
        as the eye, and where the right image ends before.

    Notes
    -----
    Likelihood ratios of two hypotheses, for Gaussian noise. Blocks and smoothness make disparity
    coherent where nothing supports it, and flatten what is small and far to the ground around;
    this looks at 3 x 3 pixels alone, less the difference in brightness that the ground around
    shows. A point at height h over the ground, to which the ray comes down by b from the eye,
    hides ground whose disparity d_g fulfils 1 / d_g = (1 + h / b) / d; with e = h + b the eye's
    height over that ground, d = d_g / (1 - h / e).
    """
    rows, columns = window
    disparity = stereo.disparity[window]
    usable = terrain.measured[window].copy()
    evidence = np.zeros((1 + len(STEP_SHARES), *disparity.shape), np.float32)
    if not usable.any():
        return evidence
    height_m = np.where(usable, terrain.height_m[window], 0)
    eye_m = terrain.eye_m[window]
    below_eye_m = eye_m - height_m
    least_m = np.float32(_LEAST_BELOW_EYE * stereo.ground.height_m)
    usable &= (below_eye_m > least_m) & (eye_m > least_m)
    on_ground = _quotient(disparity * below_eye_m, eye_m, usable)
    usable &= on_ground > 0
    column = np.arange(camera.width, dtype=np.float32)[columns]
    source_rows = stereo.alignment.rows(camera, column)[rows]
    reached = column - np.float32(camera.disparity_offset)
    reached = reached - stereo.alignment.added_disparity(camera)[rows]
    first = stereo.pair[0][window].astype(np.float32)

    def difference(hypothesis: Image) -> Image:
        seen = cv2.remap(
            stereo.pair[1], reached - hypothesis, source_rows, cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        return np.asarray(first - seen, np.float32)

    from_ground = difference(on_ground)
    brightness = _mean_around(from_ground, usable)
    squares = (from_ground - brightness) ** 2
    noise = np.float32(max(stereo.grey_noise, _LEAST_NOISE) ** 2)
    for share, found in zip((0, *STEP_SHARES), evidence, strict=True):
        hypothesis, possible = disparity, usable
        if share:
            below_m = eye_m - np.float32(share * max_step_m)
            possible = usable & (below_m > least_m)
            hypothesis = _quotient(on_ground * eye_m, below_m, possible)
        gain = squares - (difference(hypothesis) - brightness) ** 2
        gain[~(possible & (reached >= hypothesis))] = 0
        cv2.blur(gain, (_WINDOW, _WINDOW), dst=found)
        found /= noise
    return evidence


def _quotient(numerator: Image, denominator: Image, where: NDArray[np.bool_]) -> Image:
    """Divide where that is possible; 0 elsewhere."""
    divided = numerator / np.where(where, denominator, 1)
    return np.asarray(np.where(where, divided, 0), np.float32)


def _mean_around(image: Image, where: NDArray[np.bool_]) -> Image:
    """Mean of the pixels around that count."""
    counted = where.astype(np.float32)
    size = (_BRIGHTNESS_WINDOW, _BRIGHTNESS_WINDOW)
    share = cv2.blur(counted, size)
    return np.asarray(cv2.blur(image * counted, size) / np.maximum(share, 1e-6), np.float32)
