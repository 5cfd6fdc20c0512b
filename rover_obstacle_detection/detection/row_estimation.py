"""Measure by how many rows a rectified pair is off, and whether a lens still bends it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.image import GreyPair
from rover_obstacle_detection.detection.lens_distortion import STRAIGHT_LENSES, Lenses, bent_px
from rover_obstacle_detection.detection.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.row_equations import SHIFTS, UNKNOWNS, MatchedPair

Image = NDArray[np.float32]

_MIN_PIXELS = 500
_MOST_PX = 3.0
# Of the width: what bends more is no rest of a rectification.
_MOST_BENT = 0.15


@dataclass(frozen=True)
class LensEstimate:
    """What `estimate_lenses` finds.

    Parameters
    ----------
    lenses : Lenses
    alignment : RowAlignment
        Of the straightened images, in pixels of the full image.
    gain : float
        F statistic: what the lenses explain of the rows that shift and turn leave unexplained,
        over what as many unknowns of chance would; 0 where they cannot be told.
    moved_px : float
        How far this moved the rows of matched pixels from what was known, mean, pixels of the
        full image.
    """

    lenses: Lenses
    alignment: RowAlignment
    gain: float
    moved_px: float


def estimate_row_alignment(
    pair: GreyPair, disparity: Image, camera: StereoCamera, reduction: float
) -> RowAlignment:
    """Measure the rows by which a pair is off, over the whole image at once.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
        Of the disparity's size.
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    camera : StereoCamera
        Of the disparity's size.
    reduction : float
        Pixels of the full image in one of these.

    Returns
    -------
    RowAlignment
        In pixels of the full image, lenses taken for straight; none where too little is matched.

    Notes
    -----
    Gauss-Newton on the grey difference after warping by the disparity (Lucas and Kanade 1981),
    with two unknowns for the image. Disparity is itself wrong by a fraction of a pixel, and
    slanting texture would take that for a shift of rows: each window's own error of disparity is
    eliminated first.
    """
    if np.count_nonzero(disparity) < _MIN_PIXELS:
        return STRAIGHT
    matched = MatchedPair(pair, disparity, camera, STRAIGHT, STRAIGHT_LENSES)
    found = matched.alignment(matched.solve(SHIFTS))
    if max(abs(found.offset_px), abs(found.turn) * camera.width / 2) * reduction > _MOST_PX:
        return STRAIGHT
    return found.reduced(1 / reduction)


def estimate_lenses(
    pair: GreyPair,
    disparity: Image,
    camera: StereoCamera,
    reduction: float,
    alignment: RowAlignment,
    lenses: Lenses,
) -> LensEstimate:
    """Measure what distortion rectification left, and how much that explains.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
        Straightened by the lenses that are known; of the disparity's size.
    disparity : ndarray of float32, shape (height, width)
        As matched with what is known, pixels, the camera's offset taken off; 0 where there is no
        match.
    camera : StereoCamera
        Of the disparity's size.
    reduction : float
        Pixels of the full image in one of these.
    alignment : RowAlignment
        What is known, in pixels of the full image.
    lenses : Lenses
        What is known.

    Notes
    -----
    A lens that still bends moves rows in the corners and columns at the sides, where it makes
    flat ground fall away. Both follow from the same coefficients: those that the rows tell
    straighten the columns as well.
    """
    nothing = LensEstimate(lenses, alignment, 0.0, 0.0)
    if np.count_nonzero(disparity) < _MIN_PIXELS:
        return nothing
    matched = MatchedPair(pair, disparity, camera, alignment.reduced(reduction), lenses)
    change = matched.solve(UNKNOWNS)
    found = matched.lenses(change)
    if bent_px(found, camera) > _MOST_BENT * camera.width:
        return nothing
    return LensEstimate(
        found,
        matched.alignment(change).reduced(1 / reduction),
        matched.gain_of_lenses(change),
        matched.moved_px(change) * reduction,
    )
