"""How far a matched disparity is from the true one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera

SPANS_PER_PX = 64
LARGEST_PX = 4
EDGES_PX = np.append(np.arange(LARGEST_PX * SPANS_PER_PX + 1) / SPANS_PER_PX, np.inf)
HIDDEN_PX = 1.0


@dataclass(frozen=True, eq=False)
class DisparityErrors:
    """Absolute errors of some pixels; the sum of two is of both.

    Parameters
    ----------
    counts : ndarray of int, shape (257,)
        Matched pixels in each of the spans between ``EDGES_PX``: 64 a pixel up to 4, and above.
    sum_px : float
        Of the absolute errors.
    missing : int
        Pixels with a true disparity that were not matched.
    """

    counts: NDArray[np.intp]
    sum_px: float
    missing: int

    @classmethod
    def of(
        cls,
        disparity: NDArray[np.float32],
        truth: NDArray[np.float32],
        where: NDArray[np.bool_],
    ) -> DisparityErrors:
        """Compare some pixels of a disparity with the truth.

        Parameters
        ----------
        disparity : ndarray of float32, shape (height, width)
            Pixels; 0 where there is no match.
        truth : ndarray of float32, shape (height, width)
            Pixels; NaN where it is not known, which is left out.
        where : ndarray of bool, shape (height, width)
        """
        known = where & np.isfinite(truth)
        matched = known & (disparity > 0)
        errors = np.abs(disparity[matched].astype(np.float64) - truth[matched])
        return cls(
            counts=np.histogram(errors, EDGES_PX)[0],
            sum_px=float(errors.sum()),
            missing=int(known.sum() - matched.sum()),
        )

    def __add__(self, other: DisparityErrors) -> DisparityErrors:
        return DisparityErrors(
            self.counts + other.counts, self.sum_px + other.sum_px, self.missing + other.missing
        )

    @property
    def matched(self) -> int:
        """Pixels compared."""
        return int(self.counts.sum())

    @property
    def density(self) -> float | None:
        """Share of the pixels with a true disparity that are matched."""
        known = self.matched + self.missing
        return self.matched / known if known else None

    @property
    def mean_px(self) -> float | None:
        """Mean absolute error of the matched pixels."""
        return self.sum_px / self.matched if self.matched else None

    @property
    def median_px(self) -> float | None:
        """Median absolute error of the matched pixels, interpolated within its span."""
        if not self.matched:
            return None
        half = self.matched / 2
        below = np.concatenate(([0], np.cumsum(self.counts)))
        index = int(np.searchsorted(below, half)) - 1
        start, end = EDGES_PX[index], EDGES_PX[index + 1]
        if not np.isfinite(end):
            return float(start)
        return float(start + (end - start) * (half - below[index]) / self.counts[index])

    def share_off(self, at_least_px: float) -> float | None:
        """Share of the matched pixels that are off by so much or more, to a 64th of a pixel."""
        if not self.matched:
            return None
        first = int(np.searchsorted(EDGES_PX, at_least_px))
        return float(self.counts[first:].sum() / self.matched)


def pooled_errors(parts: Sequence[DisparityErrors]) -> DisparityErrors:
    """Sum over several images."""
    whole = DisparityErrors(np.zeros(len(EDGES_PX) - 1, np.intp), 0.0, 0)
    for part in parts:
        whole = whole + part
    return whole


def true_disparity(depth_m: NDArray[np.float32], camera: StereoCamera) -> NDArray[np.float32]:
    """Disparity of a known depth.

    Parameters
    ----------
    depth_m : ndarray of float32, shape (height, width)
        Along the optical axis; NaN where there is no surface.
    camera : StereoCamera

    Returns
    -------
    ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; NaN where there is no surface.
    """
    return np.asarray(np.float32(camera.fx * camera.baseline_m) / depth_m, np.float32)


def seen_by_both(truth: NDArray[np.float32], camera: StereoCamera) -> NDArray[np.bool_]:
    """Tell the pixels of the left image whose surface the right eye sees, too.

    Parameters
    ----------
    truth : ndarray of float32, shape (height, width)
        True disparity, pixels, the camera's offset taken off; NaN where it is not known.
    camera : StereoCamera

    Returns
    -------
    ndarray of bool, shape (height, width)
        Not outside the right image, and not behind what the left eye sees elsewhere: nothing of
        that row has a disparity greater by more than 1 px and comes to the same column.
    """
    height, width = truth.shape
    with np.errstate(invalid='ignore'):
        column = np.arange(width)[np.newaxis] - truth - camera.disparity_offset
        inside = (column >= 0) & (column <= width - 1)
    place = np.rint(np.where(inside, column, 0)).astype(np.intp)
    place += width * np.arange(height)[:, np.newaxis]
    nearest = np.full(height * width, -np.inf, np.float32)
    np.maximum.at(nearest, place[inside], truth[inside])
    with np.errstate(invalid='ignore'):
        return np.asarray(inside & (truth >= nearest[place] - HIDDEN_PX))
