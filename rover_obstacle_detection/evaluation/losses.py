"""What lowers the IoU: missed obstacles, false blobs, inaccurate outlines."""

from __future__ import annotations

from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.evaluation.figures import MAX_FALSE_ALARM_SHARE, MIN_FOUND_SHARE
from rover_obstacle_detection.evaluation.labels import ROCK, connected, is_counted, is_obstacle


@dataclass(frozen=True)
class Losses:
    """Pixels in the union of mask and obstacles, by outcome; adding two pools them.

    Unlike `Figures`, obstacles and blobs of any size count.

    Parameters
    ----------
    hit : int
        Flagged, on obstacles.
    missed : int
        Not flagged, on obstacles of which less than half is flagged.
    invented : int
        Flagged free ground, in blobs with less than 10 % on obstacles.
    too_wide : int
        Flagged free ground, in all other blobs.
    too_narrow : int
        Not flagged, on obstacles of which at least half is flagged.
    outline : int
        Outline length of the obstacles of which at least half is flagged.
    """

    hit: int = 0
    missed: int = 0
    invented: int = 0
    too_wide: int = 0
    too_narrow: int = 0
    outline: int = 0

    def __add__(self, other: Losses) -> Losses:
        return Losses(
            *(getattr(self, each.name) + getattr(other, each.name) for each in fields(self))
        )

    @property
    def union(self) -> int:
        """Pixels flagged or on obstacles; IoU is `hit` over this."""
        return self.hit + self.missed + self.invented + self.too_wide + self.too_narrow

    def share(self, part: str) -> float | None:
        """Share of one outcome in the union: for a loss, what it takes off the IoU."""
        return getattr(self, part) / self.union if self.union else None

    def width_px(self, part: str) -> float | None:
        """Mean width of ``too_wide`` or ``too_narrow`` along the outlines, pixels."""
        return getattr(self, part) / self.outline if self.outline else None


def measure_losses(
    mask: NDArray[np.uint8] | NDArray[np.bool_],
    labels: NDArray[np.uint8],
    instances: NDArray[np.uint16],
) -> Losses:
    """Attribute the pixels on which mask and labels disagree.

    Parameters
    ----------
    mask, labels, instances : ndarray, shape (height, width)
        As for `score`.
    """
    flagged = mask != 0
    counted, obstacle = is_counted(labels), is_obstacle(labels)
    found = _found(flagged, labels, instances)
    invented = _invented(flagged, obstacle, counted)
    free = flagged & counted & ~obstacle
    missing = obstacle & ~flagged
    inner = cv2.erode(found.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1)
    return Losses(
        hit=int(np.count_nonzero(flagged & obstacle)),
        missed=int(np.count_nonzero(missing & ~found)),
        invented=int(np.count_nonzero(free & invented)),
        too_wide=int(np.count_nonzero(free & ~invented)),
        too_narrow=int(np.count_nonzero(missing & found)),
        outline=int(np.count_nonzero(found) - np.count_nonzero(inner)),
    )


def _found(
    flagged: NDArray[np.bool_], labels: NDArray[np.uint8], instances: NDArray[np.uint16]
) -> NDArray[np.bool_]:
    """Mark the pixels of rocks and areas of which at least half is flagged."""
    rocks = np.where(labels == ROCK, instances, 0).astype(np.int64)
    areas = connected(is_obstacle(labels) & (labels != ROCK)).astype(np.int64)
    parts = np.where(areas > 0, areas + int(rocks.max(initial=0)), rocks)
    pixels = np.bincount(parts.ravel())
    hits = np.bincount(parts[flagged], minlength=len(pixels))
    is_found = hits >= MIN_FOUND_SHARE * pixels
    is_found[0] = False
    return np.asarray(is_found[parts])


def _invented(
    flagged: NDArray[np.bool_], obstacle: NDArray[np.bool_], counted: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Mark the pixels of flagged blobs that would be false alarms at any size."""
    blobs = connected(flagged)
    pixels = np.bincount(blobs.ravel())
    excused = np.bincount(blobs[obstacle | ~counted], minlength=len(pixels))
    is_invented = excused < MAX_FALSE_ALARM_SHARE * pixels
    is_invented[0] = False
    return np.asarray(is_invented[blobs])
