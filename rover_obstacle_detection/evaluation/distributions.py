"""Roughness and elevation step on free ground and on obstacles (study, section 5.1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.evaluation.labels import FREE, is_obstacle

EDGES_M = np.concatenate(([0.0], np.geomspace(1e-5, 1.0, 101), [np.inf]))


@dataclass(frozen=True, eq=False)
class Distribution:
    """Histograms of a terrain measure on free ground and on obstacles; adding two pools them.

    Parameters
    ----------
    free, obstacle : ndarray of int, shape (102,)
        Pixels per bin of ``EDGES_M``: 20 bins a decade from 0.01 mm to 1 m, one below, one above.
    """

    free: NDArray[np.intp]
    obstacle: NDArray[np.intp]

    @classmethod
    def of(cls, values_m: NDArray[np.float32], labels: NDArray[np.uint8]) -> Distribution:
        """Count the values of one frame, without NaN and uncounted pixels."""
        known = np.isfinite(values_m)
        return cls(
            free=np.histogram(values_m[known & (labels == FREE)], EDGES_M)[0],
            obstacle=np.histogram(values_m[known & is_obstacle(labels)], EDGES_M)[0],
        )

    def __add__(self, other: Distribution) -> Distribution:
        return Distribution(self.free + other.free, self.obstacle + other.obstacle)

    @cached_property
    def separation(self) -> float | None:
        """Probability that an obstacle pixel exceeds a free one (area under the ROC curve)."""
        if not self.free.sum() or not self.obstacle.sum():
            return None
        below = np.cumsum(self.free) - self.free / 2
        return float((self.obstacle * below).sum() / (self.free.sum() * self.obstacle.sum()))

    def share_over(self, threshold_m: float) -> tuple[float | None, float | None]:
        """Shares of free and of obstacle pixels above a threshold, to 1/20 decade."""
        first = int(np.searchsorted(EDGES_M, threshold_m))
        free, obstacle = (
            float(counts[first:].sum() / counts.sum()) if counts.sum() else None
            for counts in (self.free, self.obstacle)
        )
        return free, obstacle

    def quantile(self, counts: NDArray[np.intp], share: float) -> float | None:
        """Quantile of one of the histograms, rounded up to the bin edge, metres."""
        if not counts.sum():
            return None
        index = int(np.searchsorted(np.cumsum(counts), share * counts.sum()))
        return float(EDGES_M[min(index + 1, len(EDGES_M) - 2)])


@dataclass(frozen=True, eq=False)
class TerrainDistributions:
    """Roughness and elevation step of one method."""

    roughness: Distribution
    step: Distribution

    def __add__(self, other: TerrainDistributions) -> TerrainDistributions:
        return TerrainDistributions(self.roughness + other.roughness, self.step + other.step)
