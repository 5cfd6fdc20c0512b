"""Does a pixel stand up? The right image's own word, pixel by pixel."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.ground_matching import Stereo
from rover_obstacle_detection.detection.survey import Terrain

Image = NDArray[np.float32]

_BRIGHTNESS_WINDOW = 41
_WINDOW = 3
_LEAST_NOISE = 1.0


def parallax_evidence(
    stereo: Stereo, terrain: Terrain, camera: StereoCamera, window: tuple[slice, slice]
) -> Image:
    """Compare how well the right image fits what was matched, and the ground below it.

    Parameters
    ----------
    stereo : Stereo
    terrain : Terrain
    camera : StereoCamera
    window : tuple of two slices
        Rows and columns to look at.

    Returns
    -------
    ndarray of float32, of the window's shape
        By how much more the squared grey levels differ if the pixel lay on the local ground, over
        the image's noise: positive where the pair says that it stands up, negative where the
        disparity of something near has spread over ground; 0 without 3D.

    Notes
    -----
    A likelihood ratio of two hypotheses, for Gaussian noise. Blocks and smoothness make disparity
    coherent where nothing supports it; this looks at 3 x 3 pixels alone. A point at height h over
    the ground, to which the ray comes down by b from the eye, hides ground whose disparity d_g
    fulfils 1 / d_g = (1 + h / b) / d.
    """
    rows, columns = window
    disparity = stereo.disparity[window]
    usable = terrain.measured[window].copy()
    evidence = np.zeros(disparity.shape, np.float32)
    if not usable.any():
        return evidence
    height_m = np.where(usable, terrain.height_m[window], 0)
    with np.errstate(divide='ignore'):
        inverse = (1 + height_m / terrain.below_eye_m[window]) / disparity
    usable &= inverse > 1 / np.float32(2 * camera.width)
    on_ground = np.where(usable, 1 / np.where(usable, inverse, 1), 0).astype(np.float32)
    first = stereo.pair[0][window].astype(np.float32)
    column = np.arange(camera.width, dtype=np.float32)[columns]
    source_rows = stereo.alignment.rows(camera, column)[rows]
    reached = column - np.float32(camera.disparity_offset)
    reached = reached - stereo.alignment.added_disparity(camera)[rows]
    squares = []
    for hypothesis in (on_ground, disparity):
        seen = cv2.remap(
            stereo.pair[1], reached - hypothesis, source_rows, cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        difference = first - seen
        difference -= cv2.blur(difference, (_BRIGHTNESS_WINDOW, _BRIGHTNESS_WINDOW))
        squares.append(difference * difference)
    gain = np.where(usable, squares[0] - squares[1], 0)
    evidence = np.asarray(cv2.blur(gain, (_WINDOW, _WINDOW)), np.float32)
    return evidence / np.float32(max(stereo.grey_noise, _LEAST_NOISE) ** 2)
