"""Figures by distance from the camera."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.evaluation.faults import median_distance_m
from rover_obstacle_detection.evaluation.figures import (
    Figures,
    Parts,
    are_found,
    areas_to_find,
    false_alarms,
    rocks_to_find,
)
from rover_obstacle_detection.evaluation.labels import is_counted, is_obstacle

EDGES_M = (0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 15.0, float('inf'))


def score_by_range(
    mask: NDArray[np.uint8],
    labels: NDArray[np.uint8],
    instances: NDArray[np.uint16],
    depth_m: NDArray[np.float32],
    known: NDArray[np.bool_] | None = None,
) -> tuple[Figures, ...]:
    """Score a mask by distance along the optical axis.

    A pixel counts at its own distance, an obstacle or false alarm at its median distance. Pixels
    without depth do not count.

    Parameters
    ----------
    mask, labels, instances, known : ndarray, shape (height, width)
        As for `score`.
    depth_m : ndarray of float32, shape (height, width)
        NaN where there is no surface.

    Returns
    -------
    tuple of Figures
        One per interval of ``EDGES_M``; ``frames`` is 1 where the interval has pixels.
    """
    flagged = mask != 0
    spans = len(EDGES_M) - 1
    span = np.digitize(depth_m, EDGES_M[1:-1])
    counted = is_counted(labels) & np.isfinite(depth_m)
    kind = 4 * span + 2 * flagged + is_obstacle(labels)
    pixels = np.bincount(kind[counted], minlength=4 * spans).reshape(spans, 2, 2)
    free = np.zeros((spans, 2), np.intp)
    if known is not None:
        free_kind = (2 * span + is_obstacle(labels))[counted & known & ~flagged]
        free = np.bincount(free_kind, minlength=2 * spans).reshape(spans, 2)
    rocks, areas = rocks_to_find(labels, instances), areas_to_find(labels)
    alarms = false_alarms(flagged, labels)
    rocks_by_span = _by_span(rocks, depth_m)
    rocks_found = _by_span(rocks, depth_m, are_found(rocks, flagged))
    areas_by_span = _by_span(areas, depth_m)
    areas_found = _by_span(areas, depth_m, are_found(areas, flagged))
    alarms_by_span = _by_span(alarms, depth_m)
    return tuple(
        Figures(
            frames=int(pixels[index].any()),
            true_positives=int(pixels[index, 1, 1]),
            false_positives=int(pixels[index, 1, 0]),
            false_negatives=int(pixels[index, 0, 1]),
            true_negatives=int(pixels[index, 0, 0]),
            rocks=int(rocks_by_span[index]),
            rocks_found=int(rocks_found[index]),
            areas=int(areas_by_span[index]),
            areas_found=int(areas_found[index]),
            false_alarms=int(alarms_by_span[index]),
            called_free=int(free[index, 1]),
            checked_obstacle_pixels=0 if known is None else int(pixels[index, :, 1].sum()),
            confirmed_free=int(free[index, 0]),
            checked_free_pixels=0 if known is None else int(pixels[index, :, 0].sum()),
        )
        for index in range(spans)
    )


def span_names() -> tuple[str, ...]:
    """Name the intervals: ``0-1 m`` up to ``over 15 m``."""
    last = f'over {EDGES_M[-2]:g} m'
    spans = itertools.pairwise(EDGES_M[:-1])
    return (*(f'{near:g}-{far:g} m' for near, far in spans), last)


def _by_span(
    parts: Parts, depth_m: NDArray[np.float32], which: NDArray[np.bool_] | None = None
) -> NDArray[np.intp]:
    numbers = parts.numbers if which is None else parts.numbers[which]
    distances = [median_distance_m(depth_m[parts.image == number]) for number in numbers]
    known = [distance for distance in distances if distance is not None]
    return np.bincount(np.digitize(known, EDGES_M[1:-1]), minlength=len(EDGES_M) - 1)
