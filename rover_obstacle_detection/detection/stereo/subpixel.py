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
    images = gradient, difference, gradient * gradient, gradient * difference
    sums = [_window_sums(known, images, window) for window in parameters.refinement_windows_px]
    grey_noise = _grey_noise(difference, known, sums[-1])
    noise = max(grey_noise, parameters.min_grey_noise)
    step = np.zeros_like(difference)
    for each, prior_px in zip(sums, parameters.refinement_priors_px, strict=True):
        # Texture counts where its gradient exceeds grey-level noise over the expected step.
        damping = np.float32(parameters.pixels_per_sample * noise**2 / prior_px**2)
        curvature, pull = _normal_equation(each)
        curvature += damping
        step *= damping
        step += pull
        step /= curvature
    np.clip(step, -parameters.max_refinement_px, parameters.max_refinement_px, out=step)
    refined = np.maximum(disparity - step, np.float32(1e-3))
    refined *= weight
    noise_px = _noise_px(damping / curvature, pair[0], grey_noise, parameters)
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


def _window_sums(
    known: NDArray[np.bool_], images: tuple[Image, ...], window_px: int
) -> tuple[Image, ...]:
    """Matched pixels in each window, at least 1, and the sums of the images."""
    count = _sum(known.view(np.uint8), window_px)
    np.maximum(count, np.float32(1), out=count)
    return count, *(_sum(image, window_px) for image in images)


def _normal_equation(sums: tuple[Image, ...]) -> tuple[Image, Image]:
    """Curvature and pull of the squared difference in each window, summed over its pixels.

    The sums are those of the count, the gradient, the difference, and their products.
    """
    count, gradient, difference, squares, products = sums
    mean = gradient / count
    pull = products - mean * difference
    mean *= gradient
    curvature = squares - mean
    np.maximum(curvature, np.float32(0), out=curvature)
    return curvature, pull


def _noise_px(
    prior_share: Image, grey: NDArray[np.uint8], grey_noise: float, parameters: StereoParameters
) -> Image:
    """Noise of the disparity, from how far each step was damped towards the prior."""
    noise_px = np.sqrt(prior_share)
    noise_px *= prior_share
    noise_px *= np.float32(parameters.untextured_noise_px)
    noise_px *= _distant_texture_factor(grey, grey_noise, parameters)
    noise_px *= noise_px
    noise_px += np.float32(parameters.min_noise_px**2)
    return np.sqrt(noise_px, out=noise_px)


def _distant_texture_factor(
    grey: NDArray[np.uint8], grey_noise: float, parameters: StereoParameters
) -> Image:
    """Factor by which the noise grows where a wide window shows little texture."""
    size = (parameters.distant_texture_window_px,) * 2
    variance = np.asarray(cv2.sqrBoxFilter(grey, cv2.CV_32F, size), np.float32)
    mean = cv2.boxFilter(grey, cv2.CV_32F, size)
    variance -= cv2.multiply(mean, mean, dst=mean)
    # The difference of two images has twice the variance of each.
    variance /= np.float32(max(grey_noise, parameters.min_grey_noise) ** 2 / 2)
    variance -= 1
    signal = np.sqrt(np.maximum(variance, 0, out=variance), out=variance)
    signal /= np.float32(-parameters.distant_texture_signal)
    signal += 1
    missing = np.maximum(signal, 0, out=signal)
    missing *= np.float32(parameters.distant_texture_noise)
    missing += 1
    return missing


def _grey_noise(
    difference: Image, known: NDArray[np.bool_], sums: tuple[Image, ...]
) -> float:
    """Spread of the difference around its mean in each window."""
    # A ninth of the pixels is enough for a median.
    every = np.s_[::3, ::3]
    count, _, total, *_ = sums
    sample = (difference[every] - total[every] / count[every])[known[every]]
    return robust_spread(sample) if sample.size else 1.0


def _sum(image: cv2.typing.MatLike, window_px: int) -> Image:
    size = (window_px, window_px)
    return np.asarray(cv2.boxFilter(image, cv2.CV_32F, size, normalize=False), np.float32)


def _sampled(image: cv2.typing.MatLike, columns: Image, rows: Image, interpolation: int) -> Image:
    return np.asarray(
        cv2.remap(image, columns, rows, interpolation, borderMode=cv2.BORDER_REPLICATE), np.float32
    )
