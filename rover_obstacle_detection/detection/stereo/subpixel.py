"""Disparity to a fraction of a pixel, with its noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.robust import robust_spread
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters

Image = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class RefinedDisparity:
    """Disparity to a fraction of a pixel.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    noise_px : ndarray of float32, shape (height, width)
        Standard deviation of the disparity.
    grey_noise : float
        Standard deviation of the grey-level difference between matched pixels of both images.
    """

    disparity: Image
    noise_px: Image
    grey_noise: float


def refine_disparity(
    pair: GreyPair,
    disparity: Image,
    camera: StereoCamera,
    rows: RowAlignment,
    parameters: StereoParameters,
) -> RefinedDisparity:
    """Remove the pull of semi-global matching towards whole pixels.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    camera : StereoCamera
    rows : RowAlignment
    parameters : StereoParameters

    Notes
    -----
    One Gauss-Newton step along the row (Lucas and Kanade 1981), independent of brightness. The
    grey levels that still differ after the warp measure the image noise, and a step that this
    noise could have caused is damped. Where texture is weak, semi-global matching flattens the
    disparity towards the ground plane, and only a wide window sees more than noise. So the step of
    the wide window comes first, and that of the narrow window is damped towards it. The images are
    warped once: a second warp would follow the noise.

    The returned noise falls with texture. Where texture is far away, as in a black shadow, it
    grows further. Its form and constants fit the errors on rendered ground.
    """
    known = disparity > 0
    weight = known.astype(np.float32)
    gradient, difference = _warped_difference(pair, disparity, camera, rows)
    gradient *= weight
    difference *= weight
    narrowest = parameters.refinement_windows_px[-1]
    share = np.maximum(_mean(weight, narrowest), np.float32(1 / narrowest**2))
    deviation = difference - _mean(difference, narrowest) / share
    grey_noise = _grey_noise(np.asarray(deviation, np.float32), known)
    images = weight, gradient, difference, gradient * gradient, difference * gradient
    noise = max(grey_noise, parameters.min_grey_noise)
    step, prior_share = np.zeros_like(difference), weight
    for window, prior_px in zip(
        parameters.refinement_windows_px, parameters.refinement_priors_px, strict=True
    ):
        curvature, pull, samples = _normal_equation(images, window, parameters.pixels_per_sample)
        # Texture counts where its gradient exceeds grey-level noise over the expected step.
        damping = np.float32(noise**2 / prior_px**2) / samples
        prior_share = np.asarray(damping / (curvature + damping), np.float32)
        step = pull / (curvature + damping) + step * prior_share
    step = np.clip(step, -parameters.max_refinement_px, parameters.max_refinement_px)
    refined = np.where(known, np.maximum(disparity - step, np.float32(1e-3)), 0).astype(np.float32)
    noise_px = np.float32(parameters.untextured_noise_px) * prior_share * np.sqrt(prior_share)
    noise_px *= _distant_texture_factor(pair[0], grey_noise, parameters)
    noise_px = np.hypot(noise_px, np.float32(parameters.min_noise_px))
    return RefinedDisparity(refined, noise_px, grey_noise)


def _warped_difference(
    pair: GreyPair, disparity: Image, camera: StereoCamera, rows: RowAlignment
) -> tuple[Image, Image]:
    """Horizontal gradient of the warped right image, and left minus warped right image."""
    left, right = pair[0].astype(np.float32), pair[1].astype(np.float32)
    columns = np.arange(camera.width, dtype=np.float32)
    source_rows = rows.rows(camera, columns)
    source_columns = columns[np.newaxis] - disparity - np.float32(camera.disparity_offset)
    source_columns -= rows.added_disparity(camera)
    slope = cv2.Scharr(right, cv2.CV_32F, 1, 0, scale=1 / 32)
    gradient = _sampled(slope, source_columns, source_rows, cv2.INTER_LINEAR)
    return gradient, left - _sampled(right, source_columns, source_rows, cv2.INTER_CUBIC)


def _normal_equation(
    images: tuple[Image, ...], window_px: int, pixels_per_sample: float
) -> tuple[Image, Image, Image]:
    """Curvature and pull of the squared difference in each window, and its independent samples.

    ``images`` are the weight (1 where matched), gradient and difference times it, and their
    products.
    """
    share = np.maximum(_mean(images[0], window_px), np.float32(1 / window_px**2))
    gradient, difference, squares, products = (
        _mean(each, window_px) / share for each in images[1:]
    )
    curvature = np.maximum(squares - gradient * gradient, np.float32(0))
    pull = products - difference * gradient
    samples = share * np.float32(window_px * window_px / pixels_per_sample)
    return (
        np.asarray(curvature, np.float32),
        np.asarray(pull, np.float32),
        np.asarray(samples, np.float32),
    )


def _distant_texture_factor(
    grey: NDArray[np.uint8], grey_noise: float, parameters: StereoParameters
) -> Image:
    """Factor by which the noise grows where a wide window shows little texture."""
    size = (parameters.distant_texture_window_px,) * 2
    mean = cv2.blur(grey.astype(np.float32), size)
    variance = cv2.sqrBoxFilter(grey, cv2.CV_32F, size) - mean * mean
    # The difference of two images has twice the variance of each.
    noise_variance = np.float32(max(grey_noise, parameters.min_grey_noise) ** 2 / 2)
    signal = np.sqrt(np.maximum(variance / noise_variance - 1, 0))
    missing = np.maximum(1 - signal / parameters.distant_texture_signal, 0)
    return np.asarray(1 + parameters.distant_texture_noise * missing, np.float32)


def _grey_noise(difference: Image, known: NDArray[np.bool_]) -> float:
    # A ninth of the pixels is enough for a median.
    sample = difference[::3, ::3][known[::3, ::3]]
    return robust_spread(sample) if sample.size else 1.0


def _mean(image: Image, window_px: int) -> Image:
    return np.asarray(cv2.blur(image, (window_px, window_px)), np.float32)


def _sampled(image: cv2.typing.MatLike, columns: Image, rows: Image, interpolation: int) -> Image:
    return np.asarray(
        cv2.remap(image, columns, rows, interpolation, borderMode=cv2.BORDER_REPLICATE), np.float32
    )
