"""Missed obstacles and false alarms of a mask, one by one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.evaluation.causes import (
    FALSE_ALARM,
    MISSED_AREA,
    MISSED_ROCK,
    Cause,
    FrameCauses,
)
from rover_obstacle_detection.evaluation.figures import (
    Parts,
    are_found,
    areas_to_find,
    false_alarms,
    rocks_to_find,
)


@dataclass(frozen=True)
class Fault:
    """A missed obstacle or a false alarm.

    Parameters
    ----------
    kind : str
        ``missed rock``, ``missed slope or drop`` or ``false alarm``.
    pixels : int
    distance_m : float, optional
        Median depth along the optical axis; None without depth.
    cause : Cause, optional
        Most likely cause, if determined.
    """

    kind: str
    pixels: int
    distance_m: float | None
    cause: Cause | None = None

    def __str__(self) -> str:
        where = '' if self.distance_m is None else f' at {self.distance_m:.1f} m'
        why = '' if self.cause is None else f': {self.cause}'
        return f'{self.kind} of {self.pixels} px{where}{why}'


def find_faults(
    mask: NDArray[np.uint8],
    labels: NDArray[np.uint8],
    instances: NDArray[np.uint16],
    depth_m: NDArray[np.float32] | None = None,
    causes: FrameCauses | None = None,
) -> tuple[Fault, ...]:
    """List the missed obstacles and the false alarms of a frame, largest first.

    Parameters
    ----------
    mask, labels, instances : ndarray, shape (height, width)
        As for `score`.
    depth_m : ndarray of float32, shape (height, width), optional
        NaN where there is no surface.
    causes : FrameCauses, optional
        Made from the detection that the mask belongs to.
    """
    flagged = mask != 0
    rocks, areas = rocks_to_find(labels, instances), areas_to_find(labels)
    alarms = false_alarms(flagged, labels)
    faults = [
        *_faults(MISSED_ROCK, rocks, ~are_found(rocks, flagged), depth_m, causes),
        *_faults(MISSED_AREA, areas, ~are_found(areas, flagged), depth_m, causes),
        *_faults(FALSE_ALARM, alarms, np.ones(len(alarms.numbers), bool), depth_m, causes),
    ]
    return tuple(sorted(faults, key=lambda fault: -fault.pixels))


def median_distance_m(depth_m: NDArray[np.float32]) -> float | None:
    """Median of the known depths; None if there is none."""
    known = depth_m[np.isfinite(depth_m)]
    return float(np.median(known)) if known.size else None


def _faults(
    kind: str,
    parts: Parts,
    which: NDArray[np.bool_],
    depth_m: NDArray[np.float32] | None,
    causes: FrameCauses | None,
) -> Iterator[Fault]:
    for number in parts.numbers[which]:
        inside = parts.image == number
        distance_m = None if depth_m is None else median_distance_m(depth_m[inside])
        cause = None if causes is None else causes.of(kind, inside)
        yield Fault(kind, int(inside.sum()), distance_m, cause)
