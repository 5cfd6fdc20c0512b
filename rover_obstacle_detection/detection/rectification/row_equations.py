"""By how many rows each part of a warped pair is off, and what explains that."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment

Image = NDArray[np.float32]
Floats = NDArray[np.float64]

# A third order explains hardly more, and runs away in the corners.
ORDERS = 2
SHIFTS = 2
TURNS = 2
STRAIGHT_UNKNOWNS = SHIFTS + TURNS
UNKNOWNS = STRAIGHT_UNKNOWNS + 2 * ORDERS
"""Offset and turn; the right eye's turns to the side and upwards; the orders of each lens."""

_ITERATIONS = 10
_SETTLED_PX = 0.1
_WINDOW = 7
_SMOOTHING_PX = 0.8
_OUTLIER = 3.0
_BLOCK_PX = 12
_REWEIGHTINGS = 10
_BLOCK_OUTLIER = 3.0
_RIDGE = 1.0
_MIN_BLOCKS = 5 * UNKNOWNS


class MatchedPair:
    """A pair warped by its disparity, to be moved up and down.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
        Straightened by the lenses that are known.
    disparity : ndarray of float32, shape (height, width)
        As matched with what is known, pixels, the camera's offset taken off; 0 where there is no
        match.
    camera : StereoCamera
        Of the disparity's size.
    alignment : RowAlignment
        What is known, in these pixels.
    lenses : Lenses
        What is known.

    Notes
    -----
    The unknowns are what has to be added to that, in pixels: the shift; the turn's at the image's
    width; and what a turn to the side, one upwards and each order of each lens move the rows at
    the corner farthest from the optical axis, or how they bend them there.
    """

    def __init__(
        self,
        pair: GreyPair,
        disparity: Image,
        camera: StereoCamera,
        alignment: RowAlignment,
        lenses: Lenses,
    ) -> None:
        self._camera, self._alignment, self._lenses = camera, alignment, lenses
        self._matched = disparity > 0
        columns = np.arange(camera.width, dtype=np.float32)
        self._columns = (
            columns
            - disparity
            - np.float32(camera.disparity_offset)
            - alignment.added_disparity(camera)
        )
        self._rows = alignment.rows(camera, columns)
        # What a reduced image has of finer texture than its pixels would look like a shift.
        self._first, self._second = (
            np.asarray(cv2.GaussianBlur(eye, (0, 0), _SMOOTHING_PX), np.float32) for eye in pair
        )
        x, y = camera.rays()
        self._radius = float(np.hypot(np.abs(x).max(), np.abs(y).max()))
        right_x = x - _filled(disparity) / np.float32(camera.fx)
        self._moves = np.empty((UNKNOWNS, *disparity.shape), np.float32)
        self._moves[0] = 1
        self._moves[1] = x * np.float32(camera.fx / camera.width)
        unit = np.float32(1 / self._radius)
        self._moves[SHIFTS] = (right_x * unit) * (y * unit)
        self._moves[SHIFTS + 1] = np.square(y * unit)
        self._fill_lens_moves(self._moves[STRAIGHT_UNKNOWNS : STRAIGHT_UNKNOWNS + ORDERS], x, -y)
        self._fill_lens_moves(self._moves[STRAIGHT_UNKNOWNS + ORDERS :], right_x, y)
        self._block_moves = np.stack([self._block_means(move) for move in self._moves])

    def _fill_lens_moves(self, moves: Image, x: Image, y: Image) -> None:
        unit = np.float32(1 / self._radius)
        square = np.square(x * unit) + np.square(y * unit)
        np.multiply(square, y * unit, out=moves[0])
        for lower, move in pairwise(moves):
            np.multiply(lower, square, out=move)

    def alignment(self, change: Floats) -> RowAlignment:
        """Add a change to the alignment that was known."""
        return RowAlignment(
            self._alignment.offset_px + float(change[0]),
            self._alignment.turn + float(change[1]) / self._camera.width,
        )

    def lenses(self, change: Floats) -> Lenses:
        """Add a change to the lenses that were known."""
        known = [lens.coefficients[:ORDERS] for lens in (self._lenses.left, self._lenses.right)]
        added = change[STRAIGHT_UNKNOWNS:].reshape(2, ORDERS) / self._corner_px()
        left, right = (LensDistortion(*each) for each in (np.array(known) + added).tolist())
        return Lenses(left, right)

    @property
    def tells_lenses(self) -> bool:
        """Whether enough of the image is matched to tell lenses."""
        matched = self._block_means(self._matched.astype(np.float32))
        return int(np.count_nonzero(matched)) >= _MIN_BLOCKS

    def solve(self, count: int) -> Floats:
        """Find the first so many unknowns; the others are 0."""
        change = np.zeros(UNKNOWNS)
        for _ in range(_ITERATIONS):
            step, _ = self._blocks(change).fit(count)
            change[:count] += step
            if np.abs(step).max() < _SETTLED_PX:
                break
        return change

    def _moved(self, change: Floats) -> Image:
        asked = int(np.flatnonzero(change).max(initial=0)) + 1
        return np.tensordot(change[:asked].astype(np.float32), self._moves[:asked], 1)

    def gain_of_lenses(self, change: Floats) -> float:
        """F statistic of the lenses that are known and their change, against straight ones."""
        blocks = self._blocks(change)
        if blocks.shift_px.size < _MIN_BLOCKS:
            return 0.0
        total = change + self._known_unknowns()
        blocks = replace(blocks, shift_px=blocks.shift_px + total @ blocks.moves)
        _, weight = blocks.fit(UNKNOWNS)
        bent = blocks.left_over(UNKNOWNS, weight)
        straight = blocks.left_over(STRAIGHT_UNKNOWNS, weight)
        effective = float(weight.sum() / weight.max()) - UNKNOWNS
        return (straight / max(bent, 1e-12) - 1) * effective / (2 * ORDERS)

    def _known_unknowns(self) -> Floats:
        shifts = self._alignment.offset_px, self._alignment.turn * self._camera.width
        lenses = (self._lenses.left, self._lenses.right)
        coefficients = np.array([lens.coefficients[:ORDERS] for lens in lenses])
        bends = (coefficients * self._corner_px()).ravel()
        return np.concatenate([shifts, np.zeros(TURNS), bends])

    def _corner_px(self) -> Floats:
        """Rows that each order's coefficient would move the farthest corner."""
        orders = np.arange(1, ORDERS + 1)
        return np.asarray(self._camera.fy * self._radius ** (2 * orders + 1))

    def _blocks(self, change: Floats) -> Blocks:
        warped = cv2.remap(
            self._second,
            self._columns,
            self._rows + self._moved(change),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        pull, weight = _row_pull(self._first, np.asarray(warped, np.float32), self._matched)
        sums = self._block_means(weight)
        told = sums > 1 / _BLOCK_PX**2
        return Blocks(
            self._block_moves[:, told],
            self._block_means(pull)[told] / sums[told],
            sums[told] * _BLOCK_PX**2,
        )

    def _block_means(self, image: Image) -> Floats:
        size = max(1, self._camera.width // _BLOCK_PX), max(1, self._camera.height // _BLOCK_PX)
        means = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        return np.asarray(means, np.float64).ravel()


@dataclass(frozen=True, eq=False)
class Blocks:
    """Blocks of the image, each with its own shift of rows.

    Parameters
    ----------
    moves : ndarray of float64, shape (unknowns, blocks)
        What each unknown moves each block, pixels.
    shift_px : ndarray of float64, shape (blocks,)
        By how many rows each is still off.
    weight : ndarray of float64, shape (blocks,)
        Squared gradient in it.
    """

    moves: Floats
    shift_px: Floats
    weight: Floats

    def fit(self, count: int) -> tuple[Floats, Floats]:
        """Explain the shifts by the first so many unknowns, falsely matched blocks outvoted.

        Returns
        -------
        unknowns : ndarray of float64, shape (count,)
        weight : ndarray of float64, shape (blocks,)
            Of each block in the end.

        Notes
        -----
        Iteratively reweighted least squares. No block has more to say than most: sharp things far
        away would else speak for the whole image.
        """
        if not self.weight.size:
            return np.zeros(count), self.weight
        even = np.minimum(self.weight, np.median(self.weight))
        weight = even
        for _ in range(_REWEIGHTINGS):
            found = self._solved(count, weight)
            off = self.shift_px - found @ self.moves[:count]
            spread = 1.4826 * float(np.median(np.abs(off))) + 0.01
            weight = even / np.square(1 + np.square(off / (_BLOCK_OUTLIER * spread)))
        return self._solved(count, weight), weight

    def left_over(self, count: int, weight: Floats) -> float:
        """Sum of squares that the first so many unknowns leave."""
        off = self.shift_px - self._solved(count, weight) @ self.moves[:count]
        return float(weight @ np.square(off))

    def _solved(self, count: int, weight: Floats) -> Floats:
        moves = self.moves[:count]
        # A ridge of a few pixels' weight holds an image without texture still.
        normal_matrix = (moves * weight) @ moves.T + _RIDGE * np.eye(count)
        return np.asarray(np.linalg.solve(normal_matrix, moves @ (weight * self.shift_px)))


def _filled(disparity: Image) -> Image:
    """Give what is not matched the mean disparity of its row, or of all."""
    matched = disparity > 0
    count = matched.sum(axis=1, keepdims=True)
    total = disparity.sum(axis=1, keepdims=True)
    mean = disparity.sum() / max(int(count.sum()), 1)
    rows = np.where(count > 0, total / np.maximum(count, 1), mean)
    return np.asarray(np.where(matched, disparity, rows), np.float32)


def _row_pull(first: Image, warped: Image, matched: NDArray[np.bool_]) -> tuple[Image, Image]:
    """Right side and weight of each window's equation for its shift of rows; 0 unless matched."""
    difference = first - warped
    difference -= cv2.blur(difference, (9, 9))
    spread = 1.4826 * float(np.median(np.abs(difference[matched]))) + 1e-3
    inlier = (matched & (np.abs(difference) < _OUTLIER * spread)).astype(np.float32)
    along = cv2.Scharr(warped, cv2.CV_32F, 1, 0, scale=1 / 32) * inlier
    down = cv2.Scharr(warped, cv2.CV_32F, 0, 1, scale=1 / 32) * inlier
    difference *= inlier

    def mean(image: cv2.typing.MatLike) -> Image:
        return np.asarray(cv2.blur(image, (_WINDOW, _WINDOW)), np.float32)

    # Without texture along the row there is no error of disparity to eliminate.
    share = mean(along * down) / (mean(along * along) + np.float32(0.01 * spread**2))
    pull = np.where(matched, mean(down * difference) - share * mean(along * difference), 0)
    weight = mean(down * down) - share * mean(along * down)
    weight = np.where(matched, np.maximum(weight, 0), 0)
    return np.asarray(pull, np.float32), np.asarray(weight, np.float32)
