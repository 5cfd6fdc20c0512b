"""Does a pixel stand up? The right image's own word, pixel by pixel."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.ground_matching import Stereo
from rover_obstacle_detection.detection.survey import Terrain

Image = NDArray[np.float32]

STEP_SHARES = (0.5, 1.0, 2.0)
"""Heights over the rover's step at which a pixel is tried, whatever was matched."""

_BRIGHTNESS_WINDOW = 41
_WINDOW = 3
_LEAST_NOISE = 1.0
# Nothing is tried that stands nearly as high as the eye.
_LEAST_BELOW_EYE = 0.3


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
        disparity of something near has spread over ground; 0 without 3D.

    Notes
    -----
    Likelihood ratios of two hypotheses, for Gaussian noise. Blocks and smoothness make disparity
    coherent where nothing supports it, and flatten what is small and far to the ground around;
    this looks at 3 x 3 pixels alone. A point at height h over the ground, to which the ray comes
    down by b from the eye, hides ground whose disparity d_g fulfils 1 / d_g = (1 + h / b) / d.
    """
    rows, columns = window
    disparity = stereo.disparity[window]
    usable = terrain.measured[window].copy()
    evidence = np.zeros((1 + len(STEP_SHARES), *disparity.shape), np.float32)
    if not usable.any():
        return evidence
    height_m = np.where(usable, terrain.height_m[window], 0)
    below_eye_m = terrain.below_eye_m[window]
    with np.errstate(divide='ignore'):
        inverse = (1 + height_m / below_eye_m) / disparity
    usable &= inverse > 1 / np.float32(2 * camera.width)
    on_ground = np.where(usable, 1 / np.where(usable, inverse, 1), 0).astype(np.float32)
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
    brightness = cv2.blur(from_ground, (_BRIGHTNESS_WINDOW, _BRIGHTNESS_WINDOW))
    squares = (from_ground - brightness) ** 2
    rise = np.float32(max_step_m) / np.maximum(below_eye_m + height_m, np.float32(1e-3))
    hypotheses = [disparity]
    for share in STEP_SHARES:
        nearer = np.maximum(1 - np.float32(share) * rise, np.float32(_LEAST_BELOW_EYE))
        hypotheses.append(np.asarray(on_ground / nearer, np.float32))
    noise = np.float32(max(stereo.grey_noise, _LEAST_NOISE) ** 2)
    for hypothesis, found in zip(hypotheses, evidence, strict=True):
        gain = squares - (difference(hypothesis) - brightness) ** 2
        gain[~usable] = 0
        cv2.blur(gain, (_WINDOW, _WINDOW), dst=found)
        found /= noise
    return evidence
