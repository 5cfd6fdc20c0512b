"""The figures of one frame, and their sum over many."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

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
    rocks, areas = rocks_to_find(labels, instances), areas_to_find(labels)
    return Figures(
        frames=1,
        true_positives=true_positives,
        false_positives=predicted - true_positives,
        false_negatives=actual - true_positives,
        true_negatives=int(np.count_nonzero(counted)) - predicted - actual + true_positives,
        rocks=len(rocks.numbers),
        rocks_found=int(are_found(rocks, flagged).sum()),
        areas=len(areas.numbers),
        areas_found=int(are_found(areas, flagged).sum()),
        false_alarms=len(false_alarms(flagged, labels).numbers),
    )


@dataclass(frozen=True, eq=False)
class Parts:
    """Numbered parts of an image.

    Parameters
    ----------
    numbers : ndarray of int
        Of the parts that are meant.
    image : ndarray of int, shape (height, width)
        Number of each pixel's part; also of others.
    """

    numbers: NDArray[np.intp]
    image: NDArray[Any]


def rocks_to_find(labels: NDArray[np.uint8], instances: NDArray[np.uint16]) -> Parts:
    """Find the rocks that are obstacles and large enough in the image to be looked for."""
    rocks = np.where(labels == ROCK, instances, 0)
    return Parts(_large(rocks, MIN_ROCK_PIXELS), rocks)


def areas_to_find(labels: NDArray[np.uint8]) -> Parts:
    """Find the connected areas of slope or drop that are large enough to be looked for."""
    areas = connected((labels == SLOPE) | (labels == DROP))
    return Parts(_large(areas, MIN_AREA_PIXELS), areas)


def are_found(obstacles: Parts, flagged: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which of the obstacles have at least half of their pixels flagged."""
    pixels = np.bincount(obstacles.image.ravel())
    hits = np.bincount(obstacles.image[flagged], minlength=len(pixels))
    found: NDArray[np.bool_] = (hits >= MIN_FOUND_SHARE * pixels)[obstacles.numbers]
    return found


def false_alarms(flagged: NDArray[np.bool_], labels: NDArray[np.uint8]) -> Parts:
    """Find the predicted blobs that are false alarms."""
    blobs = connected(flagged)
    count = int(blobs.max()) + 1
    counted = is_counted(labels)
    pixels = np.bincount(blobs.ravel(), minlength=count)
    excused = np.bincount(blobs[is_obstacle(labels) | ~counted], minlength=count)
    alarm = np.bincount(blobs[counted], minlength=count) >= MIN_FALSE_ALARM_PIXELS
    alarm &= excused < MAX_FALSE_ALARM_SHARE * pixels
    alarm[0] = False
    return Parts(np.flatnonzero(alarm), blobs)


def _large(parts: NDArray[Any], min_pixels: int) -> NDArray[np.intp]:
    pixels = np.bincount(parts.ravel())
    pixels[0] = 0
    return np.flatnonzero(pixels >= min_pixels)


def _ratio(part: int, whole: int) -> float | None:
    return part / whole if whole else None
