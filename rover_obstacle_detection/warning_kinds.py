"""Count the warnings of many frames by kind."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class WarningCount:
    """How often one kind of warning occurred.

    Parameters
    ----------
    text : str
        The warning of the first frame.
    frames : int
        Frames with a warning of this kind.
    first_stamp_ns : int
        Stamp of the first of them.
    """

    text: str
    frames: int
    first_stamp_ns: int


def kind_of(text: str) -> str:
    """Return the text with its numbers left out: texts that differ only in numbers are equal."""
    return re.sub(r'-?\d+(\.\d+)?', '#', text)


def count_warnings(frames: Iterable[tuple[int, Sequence[str]]]) -> tuple[WarningCount, ...]:
    """Count warnings by kind.

    Parameters
    ----------
    frames : iterable of (int, sequence of str)
        Stamp (ns) and warnings of each frame.

    Returns
    -------
    tuple of WarningCount
        In the order of first occurrence.
    """
    counts: dict[str, WarningCount] = {}
    for stamp_ns, texts in frames:
        for kind, text in {kind_of(text): text for text in texts}.items():
            before = counts.get(kind, WarningCount(text, 0, stamp_ns))
            counts[kind] = replace(before, frames=before.frames + 1)
    return tuple(counts.values())
