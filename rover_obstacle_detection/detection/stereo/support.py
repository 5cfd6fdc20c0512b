"""Whether the images support the disparity that was found in them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment
from rover_obstacle_detection.detection.stereo.parameters import SupportParameters

Image = NDArray[np.float32]
Grey = NDArray[np.uint8]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Support:
    """How far both images agree with the disparity.

    Parameters
    ----------
    supported : ndarray of bool, shape (height, width)
        Matched pixels that show texture, near or within some pixels, and the same in both images.
    plain : ndarray of bool, shape (height, width)
        Areas without texture. Matching fills them from their surroundings: what lies in them, such
        as water or a hole in black shadow, would not show.
    left_textured_share, right_textured_share : float
        Share of each image's pixels whose surroundings show more than noise.
    agreeing_share : float
        Share of the visible textured pixels that are matched and look alike in both images; 1
        where hardly any visible pixel is textured.
    same_share : float
        Share of the visible textured pixels with the same grey level at the same place in both
        images.
    """

    supported: Mask
    plain: Mask
    left_textured_share: float
    right_textured_share: float
    agreeing_share: float
    same_share: float


def measure_support(
    pair: GreyPair,
    disparity: Image,
    expected: Image,
    camera: StereoCamera,
    rows: RowAlignment,
    visible: Mask,
    noise: tuple[float, float],
    parameters: SupportParameters,
) -> Support:
    """Compare the left image with the right image warped by the disparity.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    expected : ndarray of float32, shape (height, width)
        Disparity of the ground plane, pixels.
    camera : StereoCamera
    rows : RowAlignment
    visible : ndarray of bool, shape (height, width)
        Pixels that should have a match: not the rover, not the sky, not outside the right image.
    noise : tuple of float
        Standard deviation of the noise of each image, grey levels.
    parameters : SupportParameters

    Notes
    -----
    Zero-mean normalised cross-correlation, independent of brightness and contrast. Where both
    images show no more than noise, also within a wider window, semi-global matching fills in the
    surroundings, and nothing supports it.
    """
    p = parameters
    matched = disparity > 0
    left, right = pair
    warped = _warped(right, disparity, camera, rows)
    near = _Windows(left, warped, matched, p.window_px)
    near_variance, correlation = near.least_variance, near.correlation()
    wide_variance = _wide_variance(left, warped, matched, p)
    least = np.float32(max(max(noise), p.min_noise) ** 2 * (1 + p.min_signal**2))
    shows = near_variance > least
    # Above the horizon there is no ground that could continue into what shows nothing.
    has_signal = shows | ((wide_variance > least) & (expected > 0))
    contradicted = shows & (correlation < p.min_correlation)
    contradicted |= _matches_ground(pair, correlation, disparity, expected, camera, rows, p)
    left_textured, right_textured = (
        _variance(image, p.window_px) > _clear(each, p)
        for image, each in zip(pair, noise, strict=True)
    )
    textured = visible & left_textured
    agreeing = matched & textured & (correlation > p.agreeing_correlation)
    judged = max(int(np.count_nonzero(visible)), 1)
    enough = np.count_nonzero(textured) / judged > p.min_textured_share
    return Support(
        supported=matched & has_signal & ~contradicted,
        plain=_plain_areas(left, ~shows & matched, least, p),
        left_textured_share=float(left_textured.mean()),
        right_textured_share=float(right_textured.mean()),
        agreeing_share=np.count_nonzero(agreeing) / textured.sum() if enough else 1.0,
        same_share=float((cv2.absdiff(left, right)[textured] <= 1).mean()) if enough else 0.0,
    )


class _Windows:
    """Two images compared in windows around each pixel, only where the mask says so."""

    def __init__(self, left: Grey, right: Grey, compared: Mask, window_px: int) -> None:
        mask = compared.astype(np.uint8)
        self._left, self._right, self._window = left * mask, right * mask, (window_px,) * 2
        self._per_pixel = 1 / np.maximum(self._sum(mask), np.float32(1))
        self._left_mean, self._right_mean = self._mean(self._left), self._mean(self._right)
        self._left_variance = self._variance(self._left, self._left_mean)
        self._right_variance = self._variance(self._right, self._right_mean)

    @property
    def least_variance(self) -> Image:
        """The lesser of both variances."""
        return np.minimum(self._left_variance, self._right_variance)

    def correlation(self) -> Image:
        """Zero-mean normalised cross-correlation."""
        product = cv2.multiply(self._left, self._right, dtype=cv2.CV_32F)
        covariance = self._mean(product) - self._left_mean * self._right_mean
        variances = np.maximum(self._left_variance, 0) * np.maximum(self._right_variance, 0)
        return np.asarray(covariance / np.sqrt(variances + np.float32(1e-3)), np.float32)

    def _variance(self, image: Grey, mean: Image) -> Image:
        squares = cv2.sqrBoxFilter(image, cv2.CV_32F, self._window, normalize=False)
        return np.asarray(squares * self._per_pixel - mean * mean, np.float32)

    def _mean(self, image: cv2.typing.MatLike) -> Image:
        return np.asarray(self._sum(image) * self._per_pixel, np.float32)

    def _sum(self, image: cv2.typing.MatLike) -> Image:
        total = cv2.boxFilter(image, cv2.CV_32F, self._window, normalize=False)
        return np.asarray(total, np.float32)


def _wide_variance(
    left: Grey, warped: Grey, matched: Mask, parameters: SupportParameters
) -> Image:
    """Lesser variance of both images in a wide window, from every second row and column."""
    every = np.s_[::2, ::2]
    window_px = parameters.wide_window_px // 2 | 1
    windows = _Windows(left[every], warped[every], matched[every], window_px)
    variance = windows.least_variance
    size = left.shape[::-1]
    return np.asarray(cv2.resize(variance, size, interpolation=cv2.INTER_NEAREST), np.float32)


def _matches_ground(
    pair: GreyPair,
    correlation: Image,
    disparity: Image,
    expected: Image,
    camera: StereoCamera,
    rows: RowAlignment,
    parameters: SupportParameters,
) -> Mask:
    """Pixels away from the ground plane that look just the same on it: texture that repeats."""
    p = parameters
    away = (disparity > 0) & (expected > 0)
    away &= np.abs(disparity - expected) > p.min_repetition_px
    if not away.any():
        return np.asarray(away)
    warped = _warped(pair[1], np.maximum(expected, 0), camera, rows)
    on_ground = _Windows(pair[0], warped, expected > 0, p.window_px).correlation()
    alike = on_ground > np.maximum(correlation - p.repetition_tolerance, p.agreeing_correlation)
    return np.asarray(away & alike)


def _plain_areas(left: Grey, bare: Mask, least: np.float32, parameters: SupportParameters) -> Mask:
    """Areas of bare pixels with at least one that shows no texture in a wider window either."""
    core = bare & (_variance(left, parameters.plain_window_px) <= least)
    if not core.any():
        return np.asarray(core)
    count, labels = cv2.connectedComponents(bare.astype(np.uint8), connectivity=8)
    plain = np.bincount(labels[core], minlength=count) > 0
    plain[0] = False
    # A window at the rim of the area sees what surrounds it.
    kernel = np.ones((parameters.window_px,) * 2, np.uint8)
    return np.asarray(cv2.dilate(plain[labels].astype(np.uint8), kernel) > 0)


def _clear(noise: float, parameters: SupportParameters) -> np.float32:
    """Variance above which a window shows clear texture."""
    return np.float32(max(noise, parameters.min_noise) ** 2 * (1 + parameters.clear_signal**2))


def _warped(right: Grey, disparity: Image, camera: StereoCamera, rows: RowAlignment) -> Grey:
    columns = np.arange(camera.width, dtype=np.float32)
    source = columns[np.newaxis] - disparity - np.float32(camera.disparity_offset)
    source -= rows.added_disparity(camera)
    return np.asarray(
        cv2.remap(
            right, source, rows.rows(camera, columns), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        np.uint8,
    )  # fmt: skip


def _variance(image: Grey, window_px: int) -> Image:
    squares = cv2.sqrBoxFilter(image, cv2.CV_32F, (window_px,) * 2)
    mean = cv2.boxFilter(image, cv2.CV_32F, (window_px,) * 2)
    return np.asarray(squares - mean * mean, np.float32)
