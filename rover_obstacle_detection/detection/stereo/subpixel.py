"""Disparity to a fraction of a pixel, with its noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.robust import robust_spread
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.strips import Strip, in_strips
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
    gradient, difference = np.empty_like(disparity), np.empty_like(disparity)
    right = pair[1].astype(np.float32)
    slope = cv2.Scharr(right, cv2.CV_32F, 1, 0, scale=1 / 32)
    narrowest = parameters.refinement_windows_px[-1]

    def compare(strip: Strip) -> Image:
        """Warp the right image; return how it differs in a sample of the matched pixels."""
        padded = strip.padded
        places = rows.places(disparity[padded], camera, padded.start)
        along = _sampled(slope, *places, cv2.INTER_LINEAR)
        along *= known[padded]
        off = pair[0][padded] - _sampled(right, *places, cv2.INTER_CUBIC)
        off *= known[padded]
        gradient[strip.rows], difference[strip.rows] = strip.inner(along), strip.inner(off)
        count, total = _window_sums(known[padded], (off,), narrowest)
        # A ninth of the pixels is enough for a median.
        count, total, off = (strip.inner(each)[::3, ::3] for each in (count, total, off))
        return (off - total / count)[known[strip.rows][::3, ::3]]

    sample = np.concatenate(in_strips(compare, camera.height, narrowest // 2))
    grey_noise = robust_spread(sample) if sample.size else 1.0
    refined, noise_px = np.empty_like(disparity), np.empty_like(disparity)

    def refine(strip: Strip) -> None:
        padded = strip.padded
        step, prior_share = _damped_step(
            strip, known[padded], gradient[padded], difference[padded], grey_noise, parameters
        )
        near = np.maximum(disparity[strip.rows] - step, np.float32(1e-3))
        np.multiply(near, known[strip.rows], out=refined[strip.rows])
        distant = _distant_texture_factor(pair[0][padded], grey_noise, parameters)
        noise_px[strip.rows] = _noise_px(prior_share, strip.inner(distant), parameters)

    widest = max(*parameters.refinement_windows_px, parameters.distant_texture_window_px)
    in_strips(refine, camera.height, widest // 2)
    return RefinedDisparity(refined, noise_px, grey_noise)


def _damped_step(
    strip: Strip,
    known: NDArray[np.bool_],
    gradient: Image,
    difference: Image,
    grey_noise: float,
    parameters: StereoParameters,
) -> tuple[Image, Image]:
    """Step of each pixel of a strip, and how far it was damped towards that of the wide window.

    The images are those of the padded strip.
    """
    images = gradient, difference, gradient * gradient, gradient * difference
    noise = max(grey_noise, parameters.min_grey_noise)
    step: Image = np.zeros((1, 1), np.float32)
    prior_share = step
    for window, prior_px in zip(
        parameters.refinement_windows_px, parameters.refinement_priors_px, strict=True
    ):
        # Texture counts where its gradient exceeds grey-level noise over the expected step.
        damping = np.float32(parameters.pixels_per_sample * noise**2 / prior_px**2)
        sums = (strip.inner(each) for each in _window_sums(known, images, window))
        curvature, pull = _normal_equation(*sums)
        curvature += damping
        pull += step * damping
        pull /= curvature
        step, prior_share = pull, np.asarray(damping / curvature, np.float32)
    most = np.float32(parameters.max_refinement_px)
    return np.clip(step, -most, most), prior_share


def _window_sums(
    known: NDArray[np.bool_], images: tuple[Image, ...], window_px: int
) -> tuple[Image, ...]:
    """Count the matched pixels in each window, at least 1, and sum the images."""
    count = _sum(known.view(np.uint8), window_px)
    np.maximum(count, np.float32(1), out=count)
    return count, *(_sum(each, window_px) for each in images)


def _normal_equation(
    count: Image, gradient: Image, difference: Image, squares: Image, products: Image
) -> tuple[Image, Image]:
    """Curvature and pull of the squared difference in each window, from sums over it."""
    mean = gradient / count
    pull = products - mean * difference
    mean *= gradient
    curvature = squares - mean
    return np.maximum(curvature, np.float32(0), out=curvature), pull


def _noise_px(prior_share: Image, distant: Image, parameters: StereoParameters) -> Image:
    """Noise of the disparity, from how far each step was damped, and from distant texture."""
    noise_px = np.sqrt(prior_share)
    noise_px *= prior_share
    noise_px *= np.float32(parameters.untextured_noise_px)
    noise_px *= distant
    noise_px *= noise_px
    noise_px += np.float32(parameters.min_noise_px**2)
    return np.sqrt(noise_px, out=noise_px)


def _distant_texture_factor(
    grey: NDArray[np.uint8], grey_noise: float, parameters: StereoParameters
) -> Image:
    """Factor by which the noise grows where a wide window shows little texture."""
    size = (parameters.distant_texture_window_px,) * 2
    mean = cv2.boxFilter(grey, cv2.CV_32F, size)
    variance = cv2.sqrBoxFilter(grey, cv2.CV_32F, size) - np.square(mean)
    # The difference of two images has twice the variance of each.
    noise_variance = np.float32(max(grey_noise, parameters.min_grey_noise) ** 2 / 2)
    signal = np.sqrt(np.maximum(variance / noise_variance - 1, 0))
    missing = np.maximum(1 - signal / np.float32(parameters.distant_texture_signal), 0)
    return np.asarray(1 + np.float32(parameters.distant_texture_noise) * missing, np.float32)


def _sum(image: cv2.typing.MatLike, window_px: int) -> Image:
    size = (window_px, window_px)
    return np.asarray(cv2.boxFilter(image, cv2.CV_32F, size, normalize=False), np.float32)


def _sampled(image: cv2.typing.MatLike, columns: Image, rows: Image, interpolation: int) -> Image:
    return np.asarray(
        cv2.remap(image, columns, rows, interpolation, borderMode=cv2.BORDER_REPLICATE), np.float32
    )
