"""Estimate row alignment and lens distortion of a matched pair."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.reduced_pair import ReducedPair
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT
from rover_obstacle_detection.detection.rectification.row_equations import (
    ROW_UNKNOWNS,
    UNKNOWNS,
    RowEquations,
)


@dataclass(frozen=True)
class RectificationEstimate:
    """Rectification error estimated from one match.

    Parameters
    ----------
    correction : Correction
        The rows are estimated with the lenses held at what was known.
    lens_gain : float
        F statistic of the lenses: the row shifts that only they explain, over what as many random
        unknowns would. 0 if there is no estimate of them.
    lens_change_px : float
        Mean change of the lenses from what was known, pixels of the full image.
    """

    correction: Correction
    lens_gain: float = 0.0
    lens_change_px: float = 0.0


def estimate_rectification(
    reduced: ReducedPair, disparity: NDArray[np.float32], known: Correction
) -> RectificationEstimate:
    """Estimate by how many rows the right image is off, and the distortion of both lenses.

    Parameters
    ----------
    reduced : ReducedPair
        Straightened by the known lenses.
    disparity : ndarray of float32, shape (height, width)
        As matched with the known correction, reduced pixels, without the camera's offset; 0 where
        there is no match.
    known : Correction
        What is already known, with the parameters of the estimate.

    Notes
    -----
    Gauss-Newton on the grey difference after warping by the disparity (Lucas and Kanade 1981).
    Disparity errors look like row shifts in slanted texture, so each window's own disparity error
    is eliminated first.

    Distortion moves rows in the corners and columns at the sides, where it makes flat ground fall
    away. Both follow from the same coefficients, so rows alone show how to straighten columns.
    Yaw and pitch of the right camera bend rows too. They are estimated so that they do not bias
    the distortion, but they are not corrected. Differences in focal length or in height between
    the cameras are absorbed as distortion.
    """
    parameters, camera, reduction = known.parameters, reduced.camera, reduced.reduction
    if np.count_nonzero(disparity) < parameters.min_matched_pixels:
        return RectificationEstimate(known)
    equations = RowEquations(reduced, disparity, known)
    rows = equations.rows(equations.solve(ROW_UNKNOWNS))
    shift_px = max(abs(rows.offset_px), abs(rows.turn) * camera.width / 2) * reduction
    if shift_px > parameters.max_row_shift_px:
        rows = STRAIGHT
    correction = replace(known, rows=rows.reduced(1 / reduction))
    if not equations.enough_for_lenses:
        return RectificationEstimate(correction)
    change = equations.solve(UNKNOWNS)
    lenses = equations.lenses(change)
    if lenses.max_bend_px(camera) > parameters.max_bend_share * camera.width:
        return RectificationEstimate(correction)
    return RectificationEstimate(
        replace(correction, lenses=lenses),
        equations.lens_gain(change),
        lenses.change_px(camera, known.lenses) * reduction,
    )
