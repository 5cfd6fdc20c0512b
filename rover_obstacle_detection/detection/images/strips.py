"""Work on an image in strips of rows: small arrays stay in the cache, and threads share them."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import cv2
from numpy.typing import NDArray

Result = TypeVar('Result')

# Rows of a strip: few enough for the cache, many compared with those that its windows add.
_ROWS = 120
# A multiple of the steps at which rows are sampled, so that strips sample the same rows.
_STEP = 6
_THREADS = 2


def _start() -> None:
    global _executor
    _executor = ThreadPoolExecutor(_THREADS, 'strips')


_executor: ThreadPoolExecutor
_start()
# A forked process inherits the executor, but none of its threads.
if hasattr(os, 'register_at_fork'):
    os.register_at_fork(after_in_child=_start)


@dataclass(frozen=True)
class Strip:
    """Some rows of an image.

    Parameters
    ----------
    rows : slice
        The strip itself.
    padded : slice
        With the rows around it that its windows reach.
    """

    rows: slice
    padded: slice

    def inner(self, image: NDArray[Any]) -> NDArray[Any]:
        """Cut the strip itself from an array of its padded rows."""
        first = self.rows.start - self.padded.start
        return image[first : first + self.rows.stop - self.rows.start]


def in_strips(work: Callable[[Strip], Result], height: int, reach: int = 0) -> list[Result]:
    """Do the work on each strip, in two threads unless OpenCV is limited to one.

    Never in more than two: the callers are bound by memory rather than by arithmetic. A forked
    process gets two threads of its own. OpenCV's own threads work there too; where OpenCV is built
    with OpenMP, ``cv2.setNumThreads(1)`` in the forked process keeps it from waiting for ever.

    Parameters
    ----------
    work : callable
        Called with each strip. It must only write to the rows of its strip.
    height : int
        Of the image.
    reach : int
        Rows that its windows reach beyond a strip; even where it looks at every second row.

    Returns
    -------
    list
        What the work returned, from the first rows to the last. It does not depend on the threads.
    """
    # An even number, so that two threads have the same to do.
    count = 2 * max(1, round(height / _ROWS / 2))
    rows = -(-height // (count * _STEP)) * _STEP
    strips = [
        Strip(slice(first, last), slice(max(first - reach, 0), min(last + reach, height)))
        for first in range(0, height, rows)
        for last in (min(first + rows, height),)
    ]
    if cv2.getNumThreads() < 2:
        return [work(strip) for strip in strips]
    return list(_executor.map(work, strips))
