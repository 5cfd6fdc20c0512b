"""Pixel, obstacle and false-alarm figures of a mask against labels."""

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

# Pixels. Smaller rocks, areas and blobs show too little to be scored as objects.
MIN_ROCK_PIXELS = 200
MIN_AREA_PIXELS = 2000
MIN_FALSE_ALARM_PIXELS = 100
# An obstacle is found if at least this share of it is flagged.
MIN_FOUND_SHARE = 0.5
# A blob with less than this share on obstacles or uncounted pixels is a false alarm.
MAX_FALSE_ALARM_SHARE = 0.1


@dataclass(frozen=True)
class Figures:
    """Counts over one or more frames; adding two pools them.

    A ratio without a denominator is None: a frame without obstacles has no recall.

    Parameters
    ----------
    frames : int
    true_positives, false_positives, false_negatives, true_negatives : int
        Counted pixels.
    rocks, rocks_found : int
        Rock instances with at least 200 counted pixels; those at least half flagged.
    areas, areas_found : int
        Connected slope or drop areas of at least 2,000 pixels; those at least half flagged.
    false_alarms : int
        Connected flagged blobs with at least 100 counted pixels, of which less than 10 % lies on
        obstacles or uncounted pixels.
    called_free : int
        Obstacle pixels that the method reports as known and does not flag.
    checked_obstacle_pixels : int
        Obstacle pixels in the frames where the method reports what is known; 0 for a method
        that never does.
    confirmed_free : int
        Free pixels that the method reports as known and does not flag.
    checked_free_pixels : int
        Free pixels in the frames where the method reports what is known.
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
    called_free: int = 0
    checked_obstacle_pixels: int = 0
    confirmed_free: int = 0
    checked_free_pixels: int = 0

    def __add__(self, other: Figures) -> Figures:
        return Figures(
            **{each.name: getattr(self, each.name) + getattr(other, each.name) for each in _COUNTS}
        )

    @property
    def precision(self) -> float | None:
        """Share of the flagged pixels on obstacles."""
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
        """Rocks and areas large enough to count as obstacles."""
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
        """Mean number of false alarms per frame."""
        return _ratio(self.false_alarms, self.frames)

    @property
    def called_free_share(self) -> float | None:
        """Share of the obstacle pixels called free; None if no method reported what is known."""
        return _ratio(self.called_free, self.checked_obstacle_pixels)

    @property
    def confirmed_free_share(self) -> float | None:
        """Share of the free pixels called free; None if no method reported what is known."""
        return _ratio(self.confirmed_free, self.checked_free_pixels)


_COUNTS = fields(Figures)


def score(
    mask: NDArray[np.uint8] | NDArray[np.bool_],
    labels: NDArray[np.uint8],
    instances: NDArray[np.uint16],
    known: NDArray[np.bool_] | None = None,
) -> Figures:
    """Score a mask against the labels of one frame.

    Parameters
    ----------
    mask : ndarray of uint8 or bool, shape (height, width)
        Nonzero where an obstacle is predicted.
    labels : ndarray of uint8, shape (height, width)
        0 free, 1 rock, 2 slope, 3 drop, 255 not counted.
    instances : ndarray of uint16, shape (height, width)
        Number of the rock; 0 elsewhere.
    known : ndarray of bool, shape (height, width), optional
        Pixels that the method could judge; None if it does not report them.

    Raises
    ------
    ValueError
        If mask, labels and instances differ in shape.
    """
    if not mask.shape == labels.shape == instances.shape:
        msg = f'mask {mask.shape}, labels {labels.shape} and instances {instances.shape} differ'
        raise ValueError(msg)
    flagged = mask != 0
    counted, obstacle = is_counted(labels), is_obstacle(labels)
    free = np.zeros_like(flagged) if known is None else known & ~flagged
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
        called_free=int(np.count_nonzero(free & obstacle)),
        checked_obstacle_pixels=0 if known is None else actual,
        confirmed_free=int(np.count_nonzero(free & counted & ~obstacle)),
        checked_free_pixels=0 if known is None else int(np.count_nonzero(counted)) - actual,
    )


@dataclass(frozen=True, eq=False)
class Parts:
    """Selected components of a numbered image.

    Parameters
    ----------
    numbers : ndarray of int
        Numbers of the selected components.
    image : ndarray of int, shape (height, width)
        Component number of each pixel, including components not selected.
    """

    numbers: NDArray[np.intp]
    image: NDArray[Any]


def rocks_to_find(labels: NDArray[np.uint8], instances: NDArray[np.uint16]) -> Parts:
    """Select the rocks labelled as obstacles that are large enough in the image to count."""
    rocks = np.where(labels == ROCK, instances, 0)
    return Parts(_large(rocks, MIN_ROCK_PIXELS), rocks)


def areas_to_find(labels: NDArray[np.uint8]) -> Parts:
    """Select the connected slope or drop areas that are large enough to count."""
    areas = connected((labels == SLOPE) | (labels == DROP))
    return Parts(_large(areas, MIN_AREA_PIXELS), areas)


def are_found(obstacles: Parts, flagged: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the selected obstacles of which at least half is flagged."""
    pixels = np.bincount(obstacles.image.ravel())
    hits = np.bincount(obstacles.image[flagged], minlength=len(pixels))
    found: NDArray[np.bool_] = (hits >= MIN_FOUND_SHARE * pixels)[obstacles.numbers]
    return found


def false_alarms(flagged: NDArray[np.bool_], labels: NDArray[np.uint8]) -> Parts:
    """Select the flagged blobs that are false alarms."""
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
