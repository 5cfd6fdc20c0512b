"""Whether the images support the disparity that was found in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.brightness import Levels
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.images.strips import Strip, in_strips
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
    noise: tuple[Levels, Levels],
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
    noise : tuple of ndarray of float32, shape (256,)
        Standard deviation of the noise of each image at each brightness, grey levels.
    parameters : SupportParameters

    Notes
    -----
    Zero-mean normalised cross-correlation, independent of brightness and contrast. Where both
    images show no more than noise, also within a wider window, semi-global matching fills in the
    surroundings, and nothing supports it.
    """
    p = parameters
    left_least, right_least = (_signal_variance(each, p.min_signal, p) for each in noise)
    clear = [_signal_variance(each, p.clear_signal, p) for each in noise]
    means = [cv2.blur(image, (p.window_px,) * 2) for image in pair]
    least = np.asarray(cv2.LUT(means[0], left_least), np.float32)
    plain_least = np.asarray(cv2.LUT(means[0], np.maximum(left_least, right_least)), np.float32)
    masks = [np.empty(disparity.shape, np.bool_) for _ in range(5)]

    def compare(strip: Strip) -> None:
        view = _View(pair, camera, rows, strip.padded, slice(0, camera.width))
        shown = disparity[strip.padded], expected[strip.padded], least[strip.padded]
        part = _compare(view, *shown, right_least, p)
        textured = (
            _variance(image[strip.padded], p.window_px) > cv2.LUT(mean[strip.padded], each)
            for image, mean, each in zip(pair, means, clear, strict=True)
        )
        for mask, each in zip(masks, (*part, *textured), strict=True):
            mask[strip.rows] = strip.inner(each)

    in_strips(compare, camera.height, max(p.window_px, p.wide_window_px) // 4 * 2)
    supported, bare, alike, left_textured, right_textured = masks
    textured = visible & left_textured
    same = textured & (cv2.absdiff(*pair) <= 1)
    texture, judged = np.count_nonzero(textured), max(int(np.count_nonzero(visible)), 1)
    enough = texture / judged > p.min_textured_share
    return Support(
        supported=supported,
        plain=_plain_areas(pair[0], bare, plain_least, p),
        left_textured_share=float(left_textured.mean()),
        right_textured_share=float(right_textured.mean()),
        agreeing_share=np.count_nonzero(alike & textured) / texture if enough else 1.0,
        same_share=np.count_nonzero(same) / texture if enough else 0.0,
    )


def sparse_areas(supported: Mask, visible: Mask, parameters: SupportParameters) -> Mask:
    """Find where many pixels are not supported, so that chance may support the others.

    It does where texture lies below the noise, as in black shadow.

    Parameters
    ----------
    supported : ndarray of bool, shape (height, width)
    visible : ndarray of bool, shape (height, width)
        Pixels that should have a match.
    parameters : SupportParameters
    """
    window = (parameters.wide_window_px,) * 2

    def count(mask: Mask) -> Image:
        counted = cv2.boxFilter(mask.view(np.uint8), cv2.CV_32F, window, normalize=False)
        return np.asarray(counted, np.float32)

    least = count(visible)
    least *= np.float32(parameters.min_dense_share)
    return np.asarray(count(supported & visible) < least)


class _View(NamedTuple):
    """A part of the left image, and the right image."""

    pair: GreyPair
    camera: StereoCamera
    alignment: RowAlignment
    rows: slice
    columns: slice

    @property
    def left(self) -> Grey:
        """The part of the left image."""
        return self.pair[0][self.rows, self.columns]

    def part(self, rows: slice, columns: slice) -> _View:
        """Return a part of this part."""
        return self._replace(
            rows=slice(self.rows.start + rows.start, self.rows.start + rows.stop),
            columns=slice(self.columns.start + columns.start, self.columns.start + columns.stop),
        )

    def warped(self, disparity: Image) -> Grey:
        """Show the right image as the left camera would, in this part."""
        places = self.alignment.places(disparity, self.camera, self.rows.start, self.columns.start)
        return np.asarray(
            cv2.remap(self.pair[1], *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
            np.uint8,
        )


def _compare(
    view: _View,
    disparity: Image,
    expected: Image,
    left_least: Image,
    right_least: Levels,
    parameters: SupportParameters,
) -> tuple[Mask, Mask, Mask]:
    """Compare both images in some rows.

    Parameters
    ----------
    view : _View
    disparity, expected : ndarray of float32, shape (rows, width)
    left_least : ndarray of float32, shape (rows, width)
        Variance over which a window of the left image shows more than noise.
    right_least : ndarray of float32, shape (256,)
        The same at each brightness of the right image.
    parameters : SupportParameters

    Returns
    -------
    supported, bare, alike : ndarray of bool, shape (rows, width)
        Matches that the images support; that show no texture nearby; that look alike.
    """
    p = parameters
    matched = disparity > 0
    warped = view.warped(disparity)
    least = cv2.LUT(cv2.blur(warped, (p.window_px,) * 2), right_least)
    least = np.maximum(left_least, least)
    near = _Windows(view.left, warped, matched, p.window_px)
    shows, correlation = near.least_variance > least, near.correlation()
    bare = matched & ~shows
    contradicted = shows & (correlation < p.min_correlation)
    contradicted |= _matches_ground(view, correlation, disparity, expected, p)
    has_signal = shows
    if bare.any():
        # Above the horizon there is no ground that could continue into what shows nothing.
        wide_variance = _wide_variance(view.left, warped, matched, p)
        has_signal = shows | ((wide_variance > least) & (expected > 0))
    alike = matched & (correlation > p.agreeing_correlation)
    return matched & has_signal & ~contradicted, bare, alike


class _Windows:
    """Two images compared in windows around each pixel, only where the mask says so."""

    def __init__(self, left: Grey, right: Grey, compared: Mask, window_px: int) -> None:
        mask = compared.view(np.uint8)
        self._left, self._right, self._window = left * mask, right * mask, (window_px,) * 2
        self._per_pixel = self._sum(mask)
        np.maximum(self._per_pixel, np.float32(1), out=self._per_pixel)
        np.reciprocal(self._per_pixel, out=self._per_pixel)
        self._left_mean, self._right_mean = self._mean(self._left), self._mean(self._right)
        self._left_variance = self._variance(self._left, self._left_mean)
        self._right_variance = self._variance(self._right, self._right_mean)

    @property
    def least_variance(self) -> Image:
        """The lesser of both variances."""
        return np.minimum(self._left_variance, self._right_variance)

    def correlation(self) -> Image:
        """Zero-mean normalised cross-correlation."""
        correlation = self._mean(cv2.multiply(self._left, self._right, dtype=cv2.CV_32F))
        correlation -= self._left_mean * self._right_mean
        variances = np.maximum(self._left_variance, 0)
        variances *= np.maximum(self._right_variance, 0)
        variances += np.float32(1e-3)
        correlation /= np.sqrt(variances, out=variances)
        return correlation

    def _variance(self, image: Grey, mean: Image) -> Image:
        squares = cv2.sqrBoxFilter(image, cv2.CV_32F, self._window, normalize=False)
        variance = np.asarray(squares, np.float32)
        variance *= self._per_pixel
        variance -= np.square(mean)
        return variance

    def _mean(self, image: cv2.typing.MatLike) -> Image:
        mean = self._sum(image)
        mean *= self._per_pixel
        return mean

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
    view: _View,
    correlation: Image,
    disparity: Image,
    expected: Image,
    parameters: SupportParameters,
) -> Mask:
    """Pixels away from the ground plane that look just the same on it: texture that repeats."""
    p = parameters
    away = (disparity > 0) & (expected > 0)
    away &= np.abs(disparity - expected) > p.min_repetition_px
    # Often only a few rocks are.
    box = _box(away, p.window_px // 2)
    view, expected, correlation = view.part(*box), expected[box], correlation[box]
    warped = view.warped(np.maximum(expected, 0))
    on_ground = _Windows(view.left, warped, expected > 0, p.window_px).correlation()
    least = np.maximum(correlation - p.repetition_tolerance, p.agreeing_correlation)
    away[box] &= on_ground > least
    return away


def _box(mask: Mask, reach_px: int) -> tuple[slice, slice]:
    """Rows and columns within reach of the mask."""
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    last_row, last_column = np.minimum(
        (top + height + reach_px, left + width + reach_px), mask.shape
    )
    return slice(max(top - reach_px, 0), last_row), slice(max(left - reach_px, 0), last_column)


def _plain_areas(left: Grey, bare: Mask, least: Image, parameters: SupportParameters) -> Mask:
    """Areas of bare pixels with at least one that shows no texture in a wider window either."""
    areas = np.zeros_like(bare)
    box = _box(bare, max(parameters.plain_window_px, parameters.window_px) // 2)
    bare, left, least = bare[box], left[box], least[box]
    core = bare & (_variance(left, parameters.plain_window_px) <= least)
    count, labels = cv2.connectedComponents(bare.astype(np.uint8), connectivity=8)
    plain = np.bincount(labels[core], minlength=count) > 0
    plain[0] = False
    # A window at the rim of the area sees what surrounds it.
    kernel = np.ones((parameters.window_px,) * 2, np.uint8)
    areas[box] = cv2.dilate(plain[labels].astype(np.uint8), kernel) > 0
    return areas


def _signal_variance(noise: Levels, signal: float, parameters: SupportParameters) -> Levels:
    """Variance over which a window shows a signal of so many standard deviations of the noise."""
    least = np.maximum(noise, np.float32(parameters.min_noise))
    return np.asarray(np.square(least) * np.float32(1 + signal**2), np.float32)


def _variance(image: Grey, window_px: int) -> Image:
    squares = cv2.sqrBoxFilter(image, cv2.CV_32F, (window_px,) * 2)
    mean = cv2.boxFilter(image, cv2.CV_32F, (window_px,) * 2)
    return np.asarray(squares - mean * mean, np.float32)
