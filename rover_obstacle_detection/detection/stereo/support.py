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
    left, right = (image.astype(np.float32) for image in pair)
    warped = _warped(right, disparity, camera, rows)
    near = _statistics(left, warped, matched, p.window_px)
    wide = _statistics(left, warped, matched, p.wide_window_px)
    least = np.float32(max(max(noise), p.min_noise) ** 2 * (1 + p.min_signal**2))
    shows = near.least_variance > least
    has_signal = shows | (wide.least_variance > least)
    clear = np.float32(max(max(noise), p.min_noise) ** 2 * (1 + p.clear_signal**2))
    ambiguous = _matches_ground(left, right, near, disparity, expected, camera, rows, p)
    contradicted = (near.least_variance > clear) & (near.correlation < p.min_correlation)
    contradicted |= ambiguous
    left_textured, right_textured = (
        _variance(image, p.window_px) > _clear(each, p)
        for image, each in zip((left, right), noise, strict=True)
    )
    textured = visible & left_textured
    agreeing = matched & textured & (near.correlation > p.agreeing_correlation)
    judged = max(int(np.count_nonzero(visible)), 1)
    enough = np.count_nonzero(textured) / judged > p.min_textured_share
    return Support(
        supported=matched & has_signal & ~contradicted,
        plain=_plain_areas(left, ~shows & matched, least, p),
        left_textured_share=float(left_textured.mean()),
        right_textured_share=float(right_textured.mean()),
        agreeing_share=np.count_nonzero(agreeing) / textured.sum() if enough else 1.0,
        same_share=float((np.abs(left - right)[textured] <= 1).mean()) if enough else 0.0,
    )


@dataclass(frozen=True, eq=False)
class _Statistics:
    least_variance: Image
    correlation: Image


def _statistics(left: Image, warped: Image, matched: Mask, window_px: int) -> _Statistics:
    """Correlation of the matched pixels of both images, and the lesser of their variances."""
    weight = matched.astype(np.float32)
    share = np.maximum(_mean(weight, window_px), np.float32(1e-3))

    def mean(image: Image) -> Image:
        return np.asarray(_mean(image * weight, window_px) / share, np.float32)

    left_mean, right_mean = mean(left), mean(warped)
    left_variance = mean(left * left) - left_mean * left_mean
    right_variance = mean(warped * warped) - right_mean * right_mean
    covariance = mean(left * warped) - left_mean * right_mean
    product = np.maximum(left_variance, 0) * np.maximum(right_variance, 0)
    return _Statistics(
        np.minimum(left_variance, right_variance),
        np.asarray(covariance / np.sqrt(product + np.float32(1e-3)), np.float32),
    )


def _matches_ground(
    left: Image,
    right: Image,
    near: _Statistics,
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
    warped = _warped(right, np.maximum(expected, 0), camera, rows)
    on_ground = _statistics(left, warped, expected > 0, p.window_px).correlation
    alike = on_ground > np.maximum(
        near.correlation - p.repetition_tolerance, p.agreeing_correlation
    )
    return np.asarray(away & alike)


def _plain_areas(
    left: Image, bare: Mask, least: np.float32, parameters: SupportParameters
) -> Mask:
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


def _warped(right: Image, disparity: Image, camera: StereoCamera, rows: RowAlignment) -> Image:
    columns = np.arange(camera.width, dtype=np.float32)
    source = columns[np.newaxis] - disparity - np.float32(camera.disparity_offset)
    source -= rows.added_disparity(camera)
    return np.asarray(
        cv2.remap(
            right, source, rows.rows(camera, columns), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        np.float32,
    )  # fmt: skip


def _variance(image: Image, window_px: int) -> Image:
    mean = _mean(image, window_px)
    return np.asarray(_mean(image * image, window_px) - mean * mean, np.float32)


def _mean(image: Image, window_px: int) -> Image:
    return np.asarray(cv2.blur(image, (window_px, window_px)), np.float32)
