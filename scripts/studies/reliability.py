"""Reliability of the confidence: how often obstacles of a given confidence are real."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.evaluation.labels import is_counted, is_obstacle
from rover_obstacle_detection.evaluation.tables import Table, number

# Bins of confidence, finer towards 0 and 1.
EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
# Shares of pixels: a real obstacle lies this much on labelled obstacles; one with fewer counted
# pixels is ambiguous.
MIN_REAL_SHARE = 0.5
MIN_COUNTED_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class JudgedObstacles:
    """Detected obstacles that the labels can judge; adding two concatenates them.

    Parameters
    ----------
    confidence : ndarray of float64, shape (n,)
    real : ndarray of bool, shape (n,)
    """

    confidence: NDArray[np.float64]
    real: NDArray[np.bool_]

    @classmethod
    def of(cls, detection: Detection, labels: NDArray[np.uint8]) -> JudgedObstacles:
        """Check the obstacles of a detection; see `judge`."""
        is_real, is_judged = judge(detection.obstacle_numbers, labels)
        confidence = np.array([each.confidence for each in detection.obstacles], np.float64)
        return cls(confidence[is_judged], is_real[is_judged])

    def __add__(self, other: JudgedObstacles) -> JudgedObstacles:
        return JudgedObstacles(
            np.concatenate((self.confidence, other.confidence)),
            np.concatenate((self.real, other.real)),
        )

    def calibration_error(self, edges: Sequence[float] = EDGES) -> float | None:
        """Mean gap between confidence and the real share, weighted by obstacles.

        Notes
        -----
        Expected calibration error (Naeini, Cooper and Hauskrecht 2015).
        """
        bins = [each for each in reliability(self, edges) if each.count]
        gaps = [each.count * abs(each.gap) for each in bins]
        return sum(gaps) / len(self.real) if gaps else None

    def brier_score(self) -> float | None:
        """Mean squared difference of confidence and reality (1 real, 0 not)."""
        return float(np.mean((self.confidence - self.real) ** 2)) if len(self.real) else None

    def separation(self) -> float | None:
        """Probability that a real obstacle has the higher confidence (area under the ROC)."""
        real, false = self.confidence[self.real], np.sort(self.confidence[~self.real])
        if not (len(real) and len(false)):
            return None
        below = np.searchsorted(false, real, side='left')
        not_above = np.searchsorted(false, real, side='right')
        return float(np.mean(below + not_above) / (2 * len(false)))


@dataclass(frozen=True)
class ReliabilityBin:
    """Obstacles of similar confidence.

    Parameters
    ----------
    low, high : float
        Range of confidence, without `high` except in the last bin.
    count : int
    mean_confidence, share_real : float, optional
        Equal for a perfectly calibrated confidence; None in an empty bin.
    """

    low: float
    high: float
    count: int
    mean_confidence: float | None
    share_real: float | None

    @property
    def gap(self) -> float:
        """Mean confidence minus the real share; 0 in an empty bin."""
        return (self.mean_confidence or 0.0) - (self.share_real or 0.0)


def judge(
    numbers: NDArray[np.int32], labels: NDArray[np.uint8]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Mark the detected obstacles that are real, and those that the labels can judge.

    Parameters
    ----------
    numbers : ndarray of int32, shape (height, width)
        Obstacle number of each pixel, 1 to n; 0 where there is none.
    labels : ndarray of uint8, shape (height, width)
        0 free, 1 rock, 2 slope, 3 drop, 255 not counted.

    Returns
    -------
    is_real : ndarray of bool, shape (n,)
        At least half of its counted pixels are on rocks, slopes or drops.
    is_judged : ndarray of bool, shape (n,)
        At least half of its pixels are counted.
    """
    count = int(numbers.max(initial=0)) + 1
    pixels = np.bincount(numbers.ravel(), minlength=count)[1:]
    counted = np.bincount(numbers[is_counted(labels)], minlength=count)[1:]
    on_obstacles = np.bincount(numbers[is_obstacle(labels)], minlength=count)[1:]
    is_judged = (counted > 0) & (counted >= MIN_COUNTED_SHARE * pixels)
    return on_obstacles >= MIN_REAL_SHARE * counted, is_judged


def reliability(
    obstacles: JudgedObstacles, edges: Sequence[float] = EDGES
) -> tuple[ReliabilityBin, ...]:
    """Compare confidence and reality in bins of confidence.

    Parameters
    ----------
    obstacles : JudgedObstacles
    edges : sequence of float
        Bin edges, from 0 to 1.
    """
    index = np.digitize(obstacles.confidence, edges[1:-1])
    bins = []
    for position, (low, high) in enumerate(itertools.pairwise(edges)):
        inside = index == position
        count = int(inside.sum())
        bins.append(
            ReliabilityBin(
                low,
                high,
                count,
                float(obstacles.confidence[inside].mean()) if count else None,
                float(obstacles.real[inside].mean()) if count else None,
            )
        )
    return tuple(bins)


def reliability_table(
    title: str, obstacles: JudgedObstacles, edges: Sequence[float] = EDGES
) -> Table:
    """Tabulate the reliability, one row per bin and one for all obstacles."""
    rows = [
        (f'{each.low:g} to {each.high:g}', *_cells(each)) for each in reliability(obstacles, edges)
    ]
    (everything,) = reliability(obstacles, (edges[0], edges[-1]))
    header = ('confidence', 'obstacles', 'mean confidence', 'share real')
    return Table(title, header, [*rows, ('all', *_cells(everything))])


def _cells(each: ReliabilityBin) -> tuple[str, ...]:
    return str(each.count), number(each.mean_confidence), number(each.share_real)
