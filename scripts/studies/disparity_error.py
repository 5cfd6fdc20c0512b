"""Errors of a matched disparity against ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BINS_PER_PX = 64
MAX_BINNED_PX = 4
EDGES_PX = np.append(np.arange(MAX_BINNED_PX * BINS_PER_PX + 1) / BINS_PER_PX, np.inf)


@dataclass(frozen=True, eq=False)
class DisparityErrors:
    """Histogram of absolute disparity errors; adding two pools them.

    Parameters
    ----------
    counts : ndarray of int, shape (257,)
        Matched pixels per bin of ``EDGES_PX``: 64 bins a pixel up to 4 px, then one for the rest.
    sum_px : float
        Sum of the absolute errors.
    missing : int
        Pixels with a true disparity but no match.
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
        """Compare a disparity map with the truth.

        Parameters
        ----------
        disparity : ndarray of float32, shape (height, width)
            Pixels; 0 where there is no match.
        truth : ndarray of float32, shape (height, width)
            Pixels; NaN where unknown. Unknown pixels do not count.
        where : ndarray of bool, shape (height, width)
            Pixels to compare.
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
        """Matched pixels with a true disparity."""
        return int(self.counts.sum())

    @property
    def density(self) -> float | None:
        """Matched share of the pixels with a true disparity."""
        known = self.matched + self.missing
        return self.matched / known if known else None

    @property
    def mean_px(self) -> float | None:
        """Mean absolute error of the matched pixels."""
        return self.sum_px / self.matched if self.matched else None

    @property
    def median_px(self) -> float | None:
        """Median absolute error of the matched pixels, interpolated within its bin."""
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
        """Share of the matched pixels with at least this error, to 1/64 px."""
        if not self.matched:
            return None
        first = int(np.searchsorted(EDGES_PX, at_least_px))
        return float(self.counts[first:].sum() / self.matched)


def pooled_errors(parts: Sequence[DisparityErrors]) -> DisparityErrors:
    """Pool the errors of several images."""
    return sum(parts, DisparityErrors(np.zeros(len(EDGES_PX) - 1, np.intp), 0.0, 0))
