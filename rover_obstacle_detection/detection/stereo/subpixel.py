"""Disparity to a fraction of a pixel, and how well each pixel of it is known."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment

# Windows and how far the disparity of each is expected to be from that of the one before, pixels.
_WINDOWS = ((33, 0.5), (9, 0.13))
# Neighbours share their noise through smoothing: so many pixels tell as much as one.
_PIXELS_PER_SAMPLE = 2
_MOST_PX = 1.0
# Errors of matches on rendered ground, by what the window's texture tells.
_UNTEXTURED_PX = 0.35
_FLOOR_PX = 0.12
# Where a window as wide as this shows little more than noise, matches are carried in from afar.
_WIDE_WINDOW = 25
_WIDE_SIGNAL = 1.5
_FAR_TEXTURE = 1.5


@dataclass(frozen=True, eq=False)
class Refined:
    """Disparity to a fraction of a pixel.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Within 1 px of what was given; 0 where that was 0.
    noise_px : ndarray of float32, shape (height, width)
        Its standard deviation, pixels.
    grey_noise : float
        Standard deviation of the grey level between both images where they match.
    """

    disparity: NDArray[np.float32]
    noise_px: NDArray[np.float32]
    grey_noise: float


def refine_disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    alignment: RowAlignment,
) -> Refined:
    """Take out the pull of semi-global matching towards whole pixels.

    Parameters
    ----------
    left, right : ndarray of uint8, shape (height, width)
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    camera : StereoCamera
    alignment : RowAlignment

    Returns
    -------
    Refined

    Notes
    -----
    After Lucas and Kanade 1981, along the row, blind to a difference of brightness. What grey
    levels still differ after the warp tells the image's own noise; a step that this noise could
    have made is damped. Semi-global matching flattens what has little texture towards the ground
    plane, and there only a wide window sees more than noise. So the step of 33 x 33 pixels is
    found first (a normal prior of 0.5 px), and that of 9 x 9 is damped towards it (0.13 px, about
    the error of most matches). The images are warped once: a second time would follow the noise.

    The noise returned falls with texture, from SGBM's own where there is none, tails and all, and
    is up to two and a half times that where texture is far, as in a black shadow. Its powers and
    constants are those of the errors found on rendered ground.
    """
    known = disparity > 0
    weight = known.astype(np.float32)
    columns = np.arange(camera.width, dtype=np.float32)
    rows = alignment.rows(camera, columns)
    offset = np.float32(camera.disparity_offset)
    first, second = left.astype(np.float32), right.astype(np.float32)
    slope = cv2.Scharr(second, cv2.CV_32F, 1, 0, scale=1 / 32)
    source = columns[np.newaxis] - disparity - offset - alignment.added_disparity(camera)
    gradient = _sampled(slope, source, rows, cv2.INTER_LINEAR) * weight
    difference = (first - _sampled(second, source, rows, cv2.INTER_CUBIC)) * weight
    narrowest = _WINDOWS[-1][0]
    share = np.maximum(_mean(weight, narrowest), np.float32(1 / narrowest**2))
    deviation = difference - _mean(difference, narrowest) / share
    grey_noise = _spread(np.asarray(deviation, np.float32), known)
    images = weight, gradient, difference, gradient * gradient, difference * gradient
    step, untold = np.zeros_like(difference), weight
    for window, prior_px in _WINDOWS:
        curvature, pull, samples = _normal_equation(images, window)
        # Grey-level noise over the prior's: what the curvature must exceed to be believed.
        damping = np.float32(max(grey_noise, 0.5) ** 2 / prior_px**2) / samples
        untold = np.asarray(damping / (curvature + damping), np.float32)
        step = pull / (curvature + damping) + step * untold
    step = np.clip(step, -_MOST_PX, _MOST_PX)
    refined = np.where(known, np.maximum(disparity - step, np.float32(1e-3)), 0).astype(np.float32)
    noise = np.float32(_UNTEXTURED_PX) * untold * np.sqrt(untold)
    noise *= _far_texture_factor(left, grey_noise)
    return Refined(refined, np.hypot(noise, np.float32(_FLOOR_PX)), grey_noise)


def _normal_equation(
    images: tuple[NDArray[np.float32], ...], window: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Curvature and pull of the squared difference around each pixel, and how many samples tell.

    Parameters
    ----------
    images : tuple of five ndarray of float32, shape (height, width)
        1 where there is a match; gradient and difference there, their products.
    window : int
    """
    share = np.maximum(_mean(images[0], window), np.float32(1 / window**2))
    gradient, difference, squares, products = (_mean(each, window) / share for each in images[1:])
    curvature = np.maximum(squares - gradient * gradient, np.float32(0))
    pull = products - difference * gradient
    samples = share * np.float32(window * window / _PIXELS_PER_SAMPLE)
    return (
        np.asarray(curvature, np.float32),
        np.asarray(pull, np.float32),
        np.asarray(samples, np.float32),
    )


def _far_texture_factor(grey: NDArray[np.uint8], grey_noise: float) -> NDArray[np.float32]:
    """Tell by what factor the noise grows where texture is far."""
    size = (_WIDE_WINDOW, _WIDE_WINDOW)
    mean = cv2.blur(grey.astype(np.float32), size)
    variance = cv2.sqrBoxFilter(grey, cv2.CV_32F, size) - mean * mean
    # The difference of both images has twice the noise's variance.
    noise_variance = np.float32(max(grey_noise, 0.5) ** 2 / 2)
    signal = np.sqrt(np.maximum(variance / noise_variance - 1, 0))
    return np.asarray(1 + _FAR_TEXTURE * np.maximum(1 - signal / _WIDE_SIGNAL, 0), np.float32)


def _spread(difference: NDArray[np.float32], known: NDArray[np.bool_]) -> float:
    """Robust standard deviation where known, from a ninth of the pixels."""
    sample = difference[::3, ::3][known[::3, ::3]]
    return 1.4826 * float(np.median(np.abs(sample))) if sample.size else 1.0


def _mean(image: NDArray[np.float32], window: int) -> NDArray[np.float32]:
    return np.asarray(cv2.blur(image, (window, window)), np.float32)


def _sampled(
    image: cv2.typing.MatLike, columns: NDArray[np.float32], rows: NDArray[np.float32], how: int
) -> NDArray[np.float32]:
    return np.asarray(
        cv2.remap(image, columns, rows, how, borderMode=cv2.BORDER_REPLICATE), np.float32
    )
