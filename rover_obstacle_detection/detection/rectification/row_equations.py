"""Row shifts of a matched pair, as equations in the rectification errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.robust import robust_spread
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rectification.lens_distortion import LensDistortion, Lenses
from rover_obstacle_detection.detection.rectification.parameters import RectificationParameters
from rover_obstacle_detection.detection.rectification.reduced_pair import ReducedPair
from rover_obstacle_detection.detection.rectification.row_alignment import RowAlignment

Image = NDArray[np.float32]
Floats = NDArray[np.float64]

# The unknowns in order: row offset and turn; the right camera's yaw and pitch; then the radial
# coefficients of the left lens and those of the right one. A third coefficient explains hardly
# more and diverges in the corners.
ROW_UNKNOWNS = 2
STRAIGHT_UNKNOWNS = 4
LENS_ORDERS = 2
UNKNOWNS = STRAIGHT_UNKNOWNS + 2 * LENS_ORDERS


class RowEquations:
    """How far each block of a pair is from the row where it should match.

    Each unknown is a change of what is known, scaled to pixels: the offset; the turn across the
    image's width; and for yaw, pitch and each radial coefficient the row shift (or the bend of the
    rows) at the corner farthest from the optical axis.

    Parameters
    ----------
    reduced : ReducedPair
        Straightened by the known lenses.
    disparity : ndarray of float32, shape (height, width)
        As matched with the known correction, pixels, without the camera's offset; 0 where there
        is no match.
    known : Correction
    """

    def __init__(self, reduced: ReducedPair, disparity: Image, known: Correction) -> None:
        camera, parameters = reduced.camera, known.parameters
        self._camera, self._parameters = camera, parameters
        self._known_rows = known.rows.reduced(reduced.reduction)
        self._known_lenses = known.lenses
        self._matched = disparity > 0
        self._right_columns, self._right_rows = self._known_rows.places(disparity, camera)
        self._left, self._right = (
            np.asarray(cv2.GaussianBlur(image, (0, 0), parameters.smoothing_px), np.float32)
            for image in reduced.pair
        )
        x, y = camera.rays()
        self._corner_radius = float(np.hypot(np.abs(x).max(), np.abs(y).max()))
        self._basis = _row_basis(disparity, camera, self._corner_radius)
        self._block_basis = np.stack([self._block_means(each) for each in self._basis])
        self._unchanged = self._blocks(np.zeros(0))

    @property
    def enough_for_lenses(self) -> bool:
        """Whether enough blocks of the image are matched to estimate lenses."""
        matched = self._block_means(self._matched.astype(np.float32))
        return int(np.count_nonzero(matched)) >= self._min_blocks

    @property
    def _min_blocks(self) -> int:
        return self._parameters.min_blocks_per_unknown * UNKNOWNS

    def solve(self, count: int) -> Floats:
        """Gauss-Newton solution for the first `count` unknowns, shape (count,)."""
        change, blocks = np.zeros(count), self._unchanged
        for _ in range(self._parameters.max_iterations):
            step, _ = blocks.fit(count)
            change += step
            if np.abs(step).max() < self._parameters.settled_shift_px:
                break
            blocks = self._blocks(change)
        return change

    def rows(self, change: Floats) -> RowAlignment:
        """Known rows plus a solution."""
        return RowAlignment(
            self._known_rows.offset_px + float(change[0]),
            self._known_rows.turn + float(change[1]) / self._camera.width,
        )

    def lenses(self, change: Floats) -> Lenses:
        """Known lenses plus a solution for all unknowns."""
        added = change[STRAIGHT_UNKNOWNS:].reshape(2, LENS_ORDERS) / self._corner_px()
        left, right = (self._known_coefficients() + added).tolist()
        return Lenses(LensDistortion(*left), LensDistortion(*right))

    def lens_gain(self, change: Floats) -> float:
        """F statistic of the lenses, known and solved for, against lenses without distortion."""
        blocks = self._blocks(change)
        if blocks.shift_px.size < self._min_blocks:
            return 0.0
        shifts = self._known_rows.offset_px, self._known_rows.turn * self._camera.width
        bends = (self._known_coefficients() * self._corner_px()).ravel()
        known = np.concatenate([shifts, np.zeros(STRAIGHT_UNKNOWNS - ROW_UNKNOWNS), bends])
        blocks = replace(blocks, shift_px=blocks.shift_px + (change + known) @ blocks.basis)
        _, weight = blocks.fit(UNKNOWNS)
        bent = blocks.left_over(UNKNOWNS, weight)
        straight = blocks.left_over(STRAIGHT_UNKNOWNS, weight)
        effective = float(weight.sum() / weight.max()) - UNKNOWNS
        return (straight / max(bent, 1e-12) - 1) * effective / (2 * LENS_ORDERS)

    def _known_coefficients(self) -> Floats:
        lenses = self._known_lenses.left, self._known_lenses.right
        return np.array([lens.coefficients[:LENS_ORDERS] for lens in lenses])

    def _corner_px(self) -> Floats:
        """Row shift of the farthest corner per unit of each radial coefficient."""
        orders = np.arange(1, LENS_ORDERS + 1)
        return np.asarray(self._camera.fy * self._corner_radius ** (2 * orders + 1))

    def _blocks(self, change: Floats) -> Blocks:
        """Blocks that show a row shift, after a change of the first unknowns."""
        moved = np.tensordot(change.astype(np.float32), self._basis[: change.size], 1)
        warped = cv2.remap(
            self._right,
            self._right_columns,
            self._right_rows + moved,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        side, weight = _shift_equations(
            self._left, np.asarray(warped, np.float32), self._matched, self._parameters
        )
        pixels = self._parameters.block_px**2
        means = self._block_means(weight)
        shows = means > self._parameters.min_block_weight / pixels
        return Blocks(
            self._block_basis[:, shows],
            self._block_means(side)[shows] / means[shows],
            means[shows] * pixels,
            self._parameters,
        )

    def _block_means(self, image: Image) -> Floats:
        width, height = (
            max(1, side // self._parameters.block_px)
            for side in (self._camera.width, self._camera.height)
        )
        means = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
        return np.asarray(means, np.float64).ravel()


@dataclass(frozen=True, eq=False)
class Blocks:
    """Blocks of the image, each with its own row shift.

    Parameters
    ----------
    basis : ndarray of float64, shape (unknowns, blocks)
        Row shift of each block per unit of each unknown.
    shift_px : ndarray of float64, shape (blocks,)
        Row shift that remains.
    weight : ndarray of float64, shape (blocks,)
        Squared row gradient, summed over the block.
    parameters : RectificationParameters
    """

    basis: Floats
    shift_px: Floats
    weight: Floats
    parameters: RectificationParameters

    def fit(self, count: int) -> tuple[Floats, Floats]:
        """Fit the first `count` unknowns to the shifts, by iteratively reweighted least squares.

        Returns
        -------
        unknowns : ndarray of float64, shape (count,)
        weight : ndarray of float64, shape (blocks,)
            Final weight of each block: low where it is falsely matched.
        """
        if not self.weight.size:
            return np.zeros(count), self.weight
        # Sharp distant objects would otherwise outweigh the rest of the image.
        even = np.minimum(self.weight, np.median(self.weight))
        weight = even
        for _ in range(self.parameters.reweightings):
            off = self._residual(count, weight)
            limit = self.parameters.max_block_sigmas * (robust_spread(off) + 0.01)
            weight = even / np.square(1 + np.square(off / limit))
        return self._solved(count, weight), weight

    def left_over(self, count: int, weight: Floats) -> float:
        """Weighted sum of squared shifts that the first `count` unknowns do not explain."""
        return float(weight @ np.square(self._residual(count, weight)))

    def _residual(self, count: int, weight: Floats) -> Floats:
        return self.shift_px - self._solved(count, weight) @ self.basis[:count]

    def _solved(self, count: int, weight: Floats) -> Floats:
        basis = self.basis[:count]
        weighted = basis * weight
        normal_matrix = weighted @ basis.T + self.parameters.ridge * np.identity(count)
        # On a few unknowns, np.linalg.solve takes ten times longer.
        _, solution = cv2.solve(normal_matrix, weighted @ self.shift_px[:, np.newaxis])
        return np.asarray(solution, np.float64).ravel()


def _row_basis(disparity: Image, camera: StereoCamera, corner_radius: float) -> Image:
    """Row shift of each pixel per unit of each unknown, shape (unknowns, height, width)."""
    x, y = camera.rays()
    right_x = x - _filled(disparity) / np.float32(camera.fx)
    basis = np.empty((UNKNOWNS, *disparity.shape), np.float32)
    basis[0] = 1
    basis[1] = x * np.float32(camera.fx / camera.width)
    unit = np.float32(1 / corner_radius)
    x, y, right_x = x * unit, y * unit, right_x * unit
    basis[2] = right_x * y
    basis[3] = np.square(y)
    left_lens, right_lens = np.split(basis[STRAIGHT_UNKNOWNS:], 2)
    # Rows that the left lens moves down appear to move up in the right image.
    for lens, (from_x, from_y) in ((left_lens, (x, -y)), (right_lens, (right_x, y))):
        square = np.square(from_x) + np.square(from_y)
        lens[0] = square * from_y
        for order in range(1, LENS_ORDERS):
            lens[order] = lens[order - 1] * square
    return basis


def _filled(disparity: Image) -> Image:
    """Disparity with unmatched pixels set to the mean of their row, or of the image."""
    matched = disparity > 0
    count = matched.sum(axis=1, keepdims=True)
    total = disparity.sum(axis=1, keepdims=True)
    mean = disparity.sum() / max(int(count.sum()), 1)
    rows = np.where(count > 0, total / np.maximum(count, 1), mean)
    return np.asarray(np.where(matched, disparity, rows), np.float32)


def _shift_equations(
    left: Image,
    warped: Image,
    matched: NDArray[np.bool_],
    parameters: RectificationParameters,
) -> tuple[Image, Image]:
    """Equation ``weight * shift = side`` of each window's row shift; 0 where unmatched.

    Returns
    -------
    side, weight : ndarray of float32, shape (height, width)
    """
    difference = left - warped
    difference -= cv2.blur(difference, (parameters.brightness_window_px,) * 2)
    spread = robust_spread(difference[matched]) + 1e-3
    matched_share = matched.astype(np.float32)
    inlier = matched_share * (np.abs(difference) < parameters.max_grey_sigmas * spread)
    along = cv2.Scharr(warped, cv2.CV_32F, 1, 0, scale=1 / 32) * inlier
    down = cv2.Scharr(warped, cv2.CV_32F, 0, 1, scale=1 / 32) * inlier
    difference *= inlier

    def mean(image: cv2.typing.MatLike) -> Image:
        return np.asarray(cv2.blur(image, (parameters.window_px,) * 2), np.float32)

    # Eliminates the window's disparity error; without texture along the row there is none to find.
    both = mean(along * down)
    share = both / (mean(along * along) + np.float32(0.01 * spread**2))
    side = mean(down * difference) - share * mean(along * difference)
    weight = np.maximum(mean(down * down) - share * both, 0)
    side, weight = side * matched_share, weight * matched_share
    return np.asarray(side, np.float32), np.asarray(weight, np.float32)
