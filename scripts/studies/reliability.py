"""Whether obstacles are as often real as their confidence says."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.evaluation.labels import is_counted, is_obstacle
from rover_obstacle_detection.evaluation.tables import NONE, Table

EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
MIN_REAL_SHARE = 0.5
MIN_COUNTED_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class JudgedObstacles:
    """Detected obstacles that labels can judge; sums of two are both.

    Parameters
    ----------
    confidence : ndarray of float64, shape (n,)
    real : ndarray of bool, shape (n,)
    """

    confidence: NDArray[np.float64]
    real: NDArray[np.bool_]

    @classmethod
    def of(cls, detection: Detection, labels: NDArray[np.uint8]) -> JudgedObstacles:
        """Judge the obstacles of a detection; see `judge`."""
        is_real, is_judged = judge(detection.obstacle_numbers, labels)
        confidence = np.array([each.confidence for each in detection.obstacles], np.float64)
        return cls(confidence[is_judged], is_real[is_judged])

    def __add__(self, other: JudgedObstacles) -> JudgedObstacles:
        return JudgedObstacles(
            np.concatenate((self.confidence, other.confidence)),
            np.concatenate((self.real, other.real)),
        )

    def calibration_error(self, edges: Sequence[float] = EDGES) -> float | None:
        """How far the confidence is from the share that is real, mean over the obstacles.

        Notes
        -----
        The expected calibration error of Naeini, Cooper and Hauskrecht (2015).
        """
        bins = [each for each in reliability(self, edges) if each.count]
        gaps = [each.count * abs(each.gap) for each in bins]
        return sum(gaps) / len(self.real) if gaps else None

    def brier_score(self) -> float | None:
        """Mean square of the confidence less 1 for what is real, less 0 for what is not."""
        return float(np.mean((self.confidence - self.real) ** 2)) if len(self.real) else None

    def separation(self) -> float | None:
        """Chance that a real obstacle is surer than one that is not: the area under the ROC."""
        sure, unsure = self.confidence[self.real], self.confidence[~self.real]
        if not (len(sure) and len(unsure)):
            return None
        below = np.searchsorted(np.sort(unsure), sure, side='left')
        not_above = np.searchsorted(np.sort(unsure), sure, side='right')
        return float(np.mean(below + not_above) / (2 * len(unsure)))


@dataclass(frozen=True)
class ReliabilityBin:
    """Obstacles of about the same confidence; the means are None where there is none.

    Parameters
    ----------
    low, high : float
        Its confidences: from `low` to under `high`, in the last bin with `high`.
    count : int
    mean_confidence, share_real : float, optional
        The closer these two, the truer the confidence.
    """

    low: float
    high: float
    count: int
    mean_confidence: float | None
    share_real: float | None

    @property
    def gap(self) -> float:
        """Mean confidence less the share that is real; 0 where there is no obstacle."""
        return (self.mean_confidence or 0.0) - (self.share_real or 0.0)


def judge(
    numbers: NDArray[np.int32], labels: NDArray[np.uint8]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell which detected obstacles are real, and of which the labels can tell.

    Parameters
    ----------
    numbers : ndarray of int32, shape (height, width)
        Number of each pixel's obstacle, 1 to n; 0 where there is none.
    labels : ndarray of uint8, shape (height, width)
        0 free, 1 rock, 2 slope, 3 drop, 255 not counted.

    Returns
    -------
    is_real : ndarray of bool, shape (n,)
        At least half of its counted pixels are on rocks, slopes or drops.
    is_judged : ndarray of bool, shape (n,)
        At least half of its pixels are counted: the rim of a rock that is neither obstacle nor
        free ground does not make it a false alarm.
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
    """Compare confidence and truth, a bin of confidence at a time.

    Parameters
    ----------
    obstacles : JudgedObstacles
    edges : sequence of float
        Of the bins, from 0 to 1.
    """
    index = np.digitize(obstacles.confidence, edges[1:-1])
    bins = []
    for number, (low, high) in enumerate(itertools.pairwise(edges)):
        inside = index == number
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
    """Tabulate confidence and truth, a row a bin of confidence and one for all."""
    rows = [
        (f'{each.low:g} to {each.high:g}', *_cells(each)) for each in reliability(obstacles, edges)
    ]
    (everything,) = reliability(obstacles, (edges[0], edges[-1]))
    header = ('confidence', 'obstacles', 'mean confidence', 'share real')
    return Table(title, header, [*rows, ('all', *_cells(everything))])


def _cells(each: ReliabilityBin) -> tuple[str, ...]:
    means = (each.mean_confidence, each.share_real)
    return str(each.count), *(NONE if mean is None else f'{mean:.3f}' for mean in means)
