"""Pairs that cannot be judged, and why: the reason in words that say what to do."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.stereo.parameters import SupportParameters
from rover_obstacle_detection.detection.stereo.support import Support
from rover_obstacle_detection.errors import UnjudgeablePairError

Grey = NDArray[np.uint8]


def check_pair(
    pair: GreyPair,
    support: Support,
    matched_share: float,
    reduction: float,
    parameters: SupportParameters,
) -> tuple[str, ...]:
    """Reject a pair whose images do not support each other, and warn if they hardly do.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
        As matched: rectified, with the residual row shift corrected.
    support : Support
    matched_share : float
        Share of the visible pixels that are matched and supported.
    reduction : float
        Side of a pixel in pixels of the images as recorded, in which faults are named.
    parameters : SupportParameters

    Returns
    -------
    tuple of str
        Warnings.

    Raises
    ------
    UnjudgeablePairError
        If nothing can be said about the ground.
    """
    p = parameters
    left, right = support.left_textured_share, support.right_textured_share
    if support.same_share > p.max_same_share:
        raise UnjudgeablePairError('both images are the same: is one camera on both sides?')
    if max(left, right) < p.min_textured_share:
        if matched_share < p.min_matched_share:
            msg = f'neither image shows any texture: {_exposure(pair[0])}'
            raise UnjudgeablePairError(msg)
        return ()
    for side, one, other, image in (
        ('left', left, right, pair[0]),
        ('right', right, left, pair[1]),
    ):
        if one < p.min_texture_ratio * other:
            msg = f'the {side} image shows hardly any texture, the other does: {_exposure(image)}'
            raise UnjudgeablePairError(msg)
    agreeing = support.agreeing_share
    if agreeing >= p.doubtful_agreeing_share:
        return ()
    fault = _fault(pair, reduction, p)
    if fault or agreeing < p.min_agreeing_share:
        msg = f'{fault or _UNRELATED}: {_percent(agreeing)} match'
        raise UnjudgeablePairError(msg)
    return (f'{_UNRELATED}: only {_percent(agreeing)} match',)


_UNRELATED = (
    'the right image does not belong to the left one, check that both come from the same camera '
    'and moment and are not exchanged'
)


def _percent(share: float) -> str:
    return f'{share:.0%} of the textured pixels'


def _exposure(image: Grey) -> str:
    """Say why an image may show nothing."""
    mean = float(image.mean())
    if mean > 240:
        return 'it is white, check the exposure'
    if mean < 15:
        return 'it is black, check the lens cap, the light and the exposure'
    return 'check for a covered or fogged lens'


def _fault(pair: GreyPair, reduction: float, parameters: SupportParameters) -> str:
    """Name what keeps two images from matching, if it can be seen in them."""
    for side, ratio in zip(('left', 'right'), _sharpness_ratios(pair), strict=True):
        if ratio < parameters.min_sharpness_ratio:
            return f'the {side} image is out of focus or smeared'
    rows = round(row_offset(pair, parameters) * reduction)
    if rows:
        where = 'lower' if rows > 0 else 'higher'
        return f'the right image is {abs(rows)} rows {where} than the left one, rectify them'
    return ''


def _sharpness_ratios(pair: GreyPair) -> tuple[float, float]:
    """Fine over coarse contrast of each image, relative to the other image."""
    left, right = (_sharpness(image) for image in pair)
    return left / right, right / left


def _sharpness(image: Grey) -> float:
    """Contrast at two pixels over contrast at eight; noise hardly counts at either."""
    half = cv2.pyrDown(image).astype(np.float32)
    quarter = cv2.pyrDown(half)
    eighth = cv2.pyrDown(quarter)
    fine = half - cv2.pyrUp(quarter, dstsize=half.shape[::-1])
    coarse = quarter - cv2.pyrUp(eighth, dstsize=quarter.shape[::-1])
    return float((fine.std() + 0.1) / (coarse.std() + 0.1))


def row_offset(pair: GreyPair, parameters: SupportParameters) -> int:
    """Rows by which the right image is lower, from the means of strips; 0 if none stand out.

    The grey level summed along strips of rows hardly depends on disparity.
    """
    profiles = []
    for image in pair:
        strips = np.array_split(image.astype(np.float32), parameters.offset_strips, axis=1)
        profile = np.stack([strip.mean(axis=1) for strip in strips])
        profiles.append(profile - cv2.blur(profile, (parameters.offset_window_px, 1)))
    left, right = profiles
    most = min(parameters.max_row_offset_px, left.shape[1] // 4)
    inner = left[:, most:-most]
    offsets = np.arange(-most, most + 1)
    scores = np.array(
        [_correlation(inner, np.roll(right, -rows, axis=1)[:, most:-most]) for rows in offsets]
    )
    best = int(np.argmax(scores))
    stands_out = scores[best] > scores[most] + parameters.min_offset_gain
    similar = scores[best] > parameters.min_offset_correlation
    return int(offsets[best]) if stands_out and similar else 0


def _correlation(one: NDArray[Any], other: NDArray[Any]) -> float:
    product = float(np.sum(one * other))
    return product / float(np.sqrt(np.sum(one * one) * np.sum(other * other)) + 1e-6)
