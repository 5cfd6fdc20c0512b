"""Check the values in calibration files; errors name the key and what was expected."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rover_obstacle_detection.errors import CameraError
from rover_obstacle_detection.wording import counted


def numbers(
    content: Mapping[str, Any], key: str, counts: Iterable[int] | None = None
) -> tuple[float, ...]:
    """Return the numbers of a key: a list, nested lists, or a matrix with ``data``.

    Parameters
    ----------
    content : mapping
    key : str
    counts : iterable of int, optional
        How many numbers are accepted; any number of them if omitted.

    Raises
    ------
    CameraError
        If the key is missing, has another count of numbers or is not a list of finite numbers.
    """
    accepted = None if counts is None else tuple(counts)
    expected = f'{" or ".join(map(str, accepted))} numbers' if accepted else 'numbers'
    value = content.get(key)
    if isinstance(value, Mapping):
        value = value.get('data')
    if value is None:
        raise CameraError(f'{key} is missing: expected {expected}')
    try:
        found = tuple(float(each) for each in _flat(value))
    except (TypeError, ValueError):
        found = (math.nan,)
    if not all(map(math.isfinite, found)):
        raise CameraError(f'{key} contains a value that is not a finite number: {value}')
    if accepted is not None and len(found) not in accepted:
        raise CameraError(f'{key} has {counted(len(found), "number")}: expected {expected}')
    return found


def size(content: Mapping[str, Any], key: str) -> tuple[int, int]:
    """Return width and height in pixels."""
    width, height = numbers(content, key, (2,))
    return int(width), int(height)


def _flat(value: Any) -> Iterator[Any]:
    if isinstance(value, (list, tuple)):
        for each in value:
            yield from _flat(each)
    elif isinstance(value, bool):
        raise TypeError
    else:
        yield value
