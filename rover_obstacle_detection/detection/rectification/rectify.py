"""Measure the residual rectification error of a pair while matching it coarsely."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.rectification.correction import UNCORRECTED, Correction
from rover_obstacle_detection.detection.rectification.estimate import (
    RectificationEstimate,
    estimate_rectification,
)
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.rectification.reduced_pair import ReducedPair
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment

CoarseMatch = Callable[[GreyPair, RowAlignment], NDArray[np.float32]]
"""Matches a reduced pair whose rows are off, in its own pixels; 0 where there is no match."""


@dataclass(frozen=True, eq=False)
class Rectified:
    """Coarse disparity of the corrected pair.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Reduced pixels, without the camera's offset; 0 where there is no match.
    camera : StereoCamera
        Of the reduced size.
    reduction : float
        Side of a reduced pixel in pixels of the full image.
    correction : Correction
    """

    disparity: NDArray[np.float32]
    camera: StereoCamera
    reduction: float
    correction: Correction = UNCORRECTED


def rectify(
    reduced: ReducedPair, match: CoarseMatch, parameters: RectificationParameters
) -> Rectified:
    """Match a reduced pair and measure its rectification error.

    Lenses are corrected only if they explain the row shifts much better than chance does. Then
    the pair is straightened, matched and measured again in turn.
    """
    disparity = match(reduced.pair, STRAIGHT)
    uncorrected = Correction(parameters=parameters)
    estimate = estimate_rectification(reduced, disparity, uncorrected)
    if estimate.lens_gain > parameters.min_first_lens_gain:
        straightened = _with_straight_lenses(reduced, match, estimate, parameters)
        if straightened is not None:
            return straightened
    rows = estimate.correction.rows
    turned = rows.added_disparity(reduced.camera) * (disparity > 0)
    return Rectified(
        np.maximum(disparity - turned, 0),
        reduced.camera,
        reduced.reduction,
        replace(uncorrected, rows=rows),
    )


def _with_straight_lenses(
    reduced: ReducedPair,
    match: CoarseMatch,
    estimate: RectificationEstimate,
    parameters: RectificationParameters,
) -> Rectified | None:
    """Straighten, match and measure until the lenses settle.

    Returns
    -------
    Rectified or None
        None if the lenses turn out to have no distortion worth correcting.
    """
    camera, reduction = reduced.camera, reduced.reduction
    for number in range(parameters.max_lens_passes):
        correction = estimate.correction
        straight = replace(reduced, pair=correction.lenses.straightened(reduced.pair, camera))
        disparity = match(straight.pair, correction.rows.reduced(reduction))
        unseen = correction.unseen(disparity, camera)
        if unseen is not None:
            disparity[unseen] = 0
        settled = number > 0 and estimate.lens_change_px < parameters.settled_lens_px
        if settled or number == parameters.max_lens_passes - 1:
            break
        estimate = estimate_rectification(straight, disparity, correction)
        if estimate.lens_gain < parameters.min_lens_gain:
            return None
    if correction.lenses.mean_bend_px(camera) * reduction < parameters.min_mean_bend_px:
        return None
    return Rectified(disparity, camera, reduction, correction)
