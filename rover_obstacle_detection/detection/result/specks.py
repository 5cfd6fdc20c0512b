"""Specks: what is too small, or too doubtful, to be an obstacle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.components import small_parts
from rover_obstacle_detection.detection.result.confidence import confidence
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import FREE, OBSTACLE, Detection


def combined_cues(
    found: Mapping[Cue, NDArray[np.bool_]],
    excluded: NDArray[np.bool_] | None,
    min_pixels: int,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Combine what each cue found. Specks and what is excluded are no obstacles.

    Returns
    -------
    cues : ndarray of uint8, shape (height, width)
        Sum of the cues of each obstacle pixel.
    mask : ndarray of uint8, shape (height, width)
        `FREE` or `OBSTACLE`.
    """
    cues = np.zeros(next(iter(found.values())).shape, np.uint8)
    for cue, where in found.items():
        cues += np.uint8(cue) * where
    obstacle = cues > 0
    obstacle &= ~small_parts(obstacle, min_pixels)
    if excluded is not None:
        obstacle &= ~excluded
    cues *= obstacle
    return cues, obstacle * np.uint8(OBSTACLE)


def around(mask: NDArray[np.uint8], reach_px: int) -> NDArray[np.bool_]:
    """Mark the pixels within reach of an obstacle, with the obstacle itself."""
    size = 2 * reach_px + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.dilate(mask, kernel) > 0)


def without_doubtful(detection: Detection) -> Detection:
    """Remove specks of steep or low ground with little confidence.

    Noise makes distant ground steep here and there. Removed pixels become unknown, not free.
    Rocks and large slopes are never removed.
    """
    parameters = detection.parameters.result
    by_ground = np.uint8(Cue.SLOPE | Cue.DROP)
    doubtful = (detection.cues > 0) & (detection.cues & ~by_ground == 0)
    doubtful &= small_parts(doubtful, round(parameters.speck_share * doubtful.size))
    if not doubtful.any():
        return detection
    numbers = detection.obstacle_numbers
    chosen = np.zeros(int(numbers.max()) + 1, np.bool_)
    chosen[numbers[doubtful]] = True
    numbers = np.where(chosen, np.cumsum(chosen), 0).astype(np.int32).take(numbers)
    judged = confidence(detection.evidence_of(numbers), parameters)
    unlikely = np.append(np.float32(1), judged) < parameters.min_confidence
    doubtful &= unlikely.take(numbers)
    if not doubtful.any():
        return detection
    return replace(
        detection,
        cues=np.where(doubtful, 0, detection.cues).astype(np.uint8),
        mask=np.where(doubtful, FREE, detection.mask).astype(np.uint8),
        known=detection.known & ~doubtful,
    )
