"""The figures of one frame, and their sum over many."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.evaluation.labels import (
    DROP,
    ROCK,
    SLOPE,
    connected,
    is_counted,
    is_obstacle,
)

MIN_ROCK_PIXELS = 200
MIN_AREA_PIXELS = 2000
MIN_FOUND_SHARE = 0.5
MIN_FALSE_ALARM_PIXELS = 100
MAX_FALSE_ALARM_SHARE = 0.1


@dataclass(frozen=True)
class Figures:
    """Counts over one or more frames; sums of two are counts over both.

    A ratio without a denominator is None: a frame without obstacles has no recall.

    Parameters
    ----------
    frames : int
    true_positives, false_positives, false_negatives, true_negatives : int
        Counted pixels.
    rocks, rocks_found : int
        Rock instances with at least 200 counted pixels, and those at least half flagged.
    areas, areas_found : int
        Connected slope or drop areas of at least 2,000 pixels, and those at least half flagged.
    false_alarms : int
        Connected predicted blobs with at least 100 counted pixels and under a tenth of their
        pixels on obstacles or pixels that are not counted.
    """

    frames: int = 0
    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0
    true_negatives: int = 0
    rocks: int = 0
    rocks_found: int = 0
    areas: int = 0
    areas_found: int = 0
    false_alarms: int = 0

    def __add__(self, other: Figures) -> Figures:
        return Figures(
            **{each.name: getattr(self, each.name) + getattr(other, each.name) for each in _COUNTS}
        )

    @property
    def precision(self) -> float | None:
        """Share of the flagged pixels that are obstacles."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def recall(self) -> float | None:
        """Share of the obstacle pixels that are flagged."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(2 * self.true_positives, 2 * self.true_positives + wrong)

    @property
    def iou(self) -> float | None:
        """Intersection of flagged and obstacle pixels over their union."""
        wrong = self.false_positives + self.false_negatives
        return _ratio(self.true_positives, self.true_positives + wrong)

    @property
    def obstacle_pixels(self) -> int:
        """Counted pixels on obstacles."""
        return self.true_positives + self.false_negatives

    @property
    def obstacles(self) -> int:
        """Rocks and areas large enough to count as an obstacle to be found."""
        return self.rocks + self.areas

    @property
    def obstacles_found(self) -> int:
        """Rocks and areas found."""
        return self.rocks_found + self.areas_found

    @property
    def obstacle_recall(self) -> float | None:
        """Share of the obstacles found."""
        return _ratio(self.obstacles_found, self.obstacles)

    @property
    def false_alarms_per_frame(self) -> float | None:
        """Mean number of false alarms in a frame."""
        return _ratio(self.false_alarms, self.frames)


_COUNTS = fields(Figures)


def score(
    mask: NDArray[np.uint8] | NDArray[np.bool_],
    labels: NDArray[np.uint8],
    instances: NDArray[np.uint16],
) -> Figures:
    """Count what a mask gets right in one labelled frame.

    Parameters
    ----------
    mask : ndarray of uint8 or bool, shape (height, width)
        Not zero where an obstacle is predicted.
    labels : ndarray of uint8, shape (height, width)
        0 free, 1 rock, 2 slope, 3 drop, 255 not counted.
    instances : ndarray of uint16, shape (height, width)
        0 where there is no rock, else the rock's number.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    if not mask.shape == labels.shape == instances.shape:
        msg = f'mask {mask.shape}, labels {labels.shape} and instances {instances.shape} differ'
        raise ValueError(msg)
    flagged = mask != 0
    counted, obstacle = is_counted(labels), is_obstacle(labels)
    true_positives = int(np.count_nonzero(flagged & obstacle))
    predicted = int(np.count_nonzero(flagged & counted))
    actual = int(np.count_nonzero(obstacle))
    rocks, rocks_found = _rocks(flagged, labels, instances)
    areas, areas_found = _areas(flagged, labels)
    return Figures(
        frames=1,
        true_positives=true_positives,
        false_positives=predicted - true_positives,
        false_negatives=actual - true_positives,
        true_negatives=int(np.count_nonzero(counted)) - predicted - actual + true_positives,
        rocks=rocks,
        rocks_found=rocks_found,
        areas=areas,
        areas_found=areas_found,
        false_alarms=len(false_alarm_numbers(flagged, labels)[0]),
    )


def false_alarm_numbers(
    flagged: NDArray[np.bool_], labels: NDArray[np.uint8]
) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """Find the predicted blobs that are false alarms.

    Returns
    -------
    numbers : ndarray of int
        Of the blobs that are false alarms.
    blobs : ndarray of int32, shape (height, width)
        Number of each pixel's blob, 0 where nothing is predicted.
    """
    count, blobs = connected(flagged)
    excused = is_obstacle(labels) | ~is_counted(labels)
    pixels = np.bincount(blobs.ravel(), minlength=count + 1)
    excused_pixels = np.bincount(blobs[excused], minlength=count + 1)
    counted_pixels = np.bincount(blobs[is_counted(labels)], minlength=count + 1)
    false_alarm = counted_pixels >= MIN_FALSE_ALARM_PIXELS
    false_alarm &= excused_pixels < MAX_FALSE_ALARM_SHARE * pixels
    false_alarm[0] = False
    return np.flatnonzero(false_alarm), blobs


def _rocks(
    flagged: NDArray[np.bool_], labels: NDArray[np.uint8], instances: NDArray[np.uint16]
) -> tuple[int, int]:
    on_rock = (labels == ROCK) & (instances != 0)
    return _found(flagged, on_rock, instances, MIN_ROCK_PIXELS)


def _areas(flagged: NDArray[np.bool_], labels: NDArray[np.uint8]) -> tuple[int, int]:
    _, numbers = connected((labels == SLOPE) | (labels == DROP))
    return _found(flagged, numbers != 0, numbers, MIN_AREA_PIXELS)


def _found(
    flagged: NDArray[np.bool_],
    where: NDArray[np.bool_],
    numbers: NDArray[np.uint16] | NDArray[np.int32],
    min_pixels: int,
) -> tuple[int, int]:
    pixels = np.bincount(numbers[where])
    flagged_pixels = np.bincount(numbers[where & flagged], minlength=len(pixels))
    large = pixels >= min_pixels
    found = large & (flagged_pixels >= MIN_FOUND_SHARE * pixels)
    return int(large.sum()), int(found.sum())


def _ratio(part: int, whole: int) -> float | None:
    return part / whole if whole else None
