"""Measure by how many rows a rectified pair is off, and whether a lens still bends it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.rectification.lens_distortion import (
    STRAIGHT_LENSES,
    Lenses,
)
from rover_obstacle_detection.detection.rectification.row_alignment import STRAIGHT, RowAlignment
from rover_obstacle_detection.detection.rectification.row_equations import (
    SHIFTS,
    UNKNOWNS,
    MatchedPair,
)

Image = NDArray[np.float32]

_MIN_PIXELS = 500
_MOST_PX = 3.0
# Of the width: what bends more is no rest of a rectification.
_MOST_BENT = 0.15


@dataclass(frozen=True)
class Rectification:
    """What `estimate_rectification` finds left of it.

    Parameters
    ----------
    alignment : RowAlignment
        In pixels of the full image, the lenses taken for what was known of them; none if it is
        far off.
    lenses : Lenses
        What was known of them, and what the rows tell beyond that.
    gain : float
        F statistic: what the lenses explain of the rows that nothing else explains, over what as
        many unknowns of chance would; 0 where they cannot be told.
    moved_px : float
        How far the lenses were moved from what was known, mean over the image, pixels of the full
        image.
    """

    alignment: RowAlignment
    lenses: Lenses
    gain: float
    moved_px: float


def estimate_rectification(
    pair: GreyPair,
    disparity: Image,
    camera: StereoCamera,
    reduction: float,
    alignment: RowAlignment = STRAIGHT,
    lenses: Lenses = STRAIGHT_LENSES,
    *,
    bent: bool = True,
) -> Rectification:
    """Measure by how many rows a pair is off, and whether a lens bends it, over the whole image.

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
    bent : bool
        Whether to ask for the lenses.

    Notes
    -----
    Gauss-Newton on the grey difference after warping by the disparity (Lucas and Kanade 1981),
    with two unknowns for the image. Disparity is itself wrong by a fraction of a pixel, and
    slanting texture would take that for a shift of rows: each window's own error of disparity is
    eliminated first.

    A lens that still bends moves rows in the corners and columns at the sides, where it makes
    flat ground fall away. Both follow from the same coefficients: those that the rows tell
    straighten the columns as well. Eyes that look past each other or at unequal heights bend rows
    too: that is allowed for, lest it be taken for a lens, but not made good. Unequal focal
    lengths and eyes that sit at unequal heights are taken for lenses.
    """
    nothing = Rectification(alignment, lenses, 0.0, 0.0)
    if np.count_nonzero(disparity) < _MIN_PIXELS:
        return nothing
    matched = MatchedPair(pair, disparity, camera, alignment.reduced(reduction), lenses)
    found = matched.alignment(matched.solve(SHIFTS))
    if max(abs(found.offset_px), abs(found.turn) * camera.width / 2) * reduction > _MOST_PX:
        found = STRAIGHT
    found = found.reduced(1 / reduction)
    if not (bent and matched.tells_lenses):
        return replace(nothing, alignment=found)
    change = matched.solve(UNKNOWNS)
    bends = matched.lenses(change)
    if bends.most_bend_px(camera) > _MOST_BENT * camera.width:
        return replace(nothing, alignment=found)
    moved_px = bends.moved_px(camera, lenses) * reduction
    return Rectification(found, bends, matched.gain_of_lenses(change), moved_px)
