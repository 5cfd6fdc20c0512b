"""The tiles of the image that the network looks at: few pixels, hardly any twice.

Their sides are multiples of `BLOCK_PX`, but at the end of the image.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.network.pixel_network import BLOCK_PX

Mask = NDArray[np.bool_]
Window = tuple[slice, slice]
"""Rows and columns of a part of the image."""

CONTEXT_BLOCKS = 1
"""Blocks around a tile that are looked at as well. The network looks farther, but more blocks
change less than one in a hundred pixels of the outlines."""

CALL_BLOCKS = 32
"""Blocks that take as long as one more call of the network. Measured on two cores."""


class Tile(NamedTuple):
    """A part of the image.

    Parameters
    ----------
    inner : tuple of two slices
        Rows and columns whose result is used; those of different tiles do not overlap.
    outer : tuple of two slices
        Rows and columns to look at.
    """

    inner: Window
    outer: Window

    def in_outer(self, window: Window) -> Window:
        """Return the same rows and columns, counted from the corner of the outer part."""
        rows, columns = (
            slice(part.start - outer.start, part.stop - outer.start)
            for part, outer in zip(window, self.outer, strict=True)
        )
        return rows, columns

    def grown(self, pixels: int) -> Window:
        """Return the inner part with some pixels around it, as far as the outer part reaches."""
        rows, columns = (
            slice(max(inner.start - pixels, outer.start), min(inner.stop + pixels, outer.stop))
            for inner, outer in zip(self.inner, self.outer, strict=True)
        )
        return rows, columns


class _Box(NamedTuple):
    top: int
    left: int
    bottom: int
    right: int


def tiles_around(where: Mask) -> list[Tile]:
    """Cover all marked pixels by tiles that take little time.

    Parameters
    ----------
    where : ndarray of bool, shape (height, width)

    Returns
    -------
    list of Tile
    """
    height, width = where.shape
    asked = _blocks(where)

    def window(box: _Box, margin: int) -> Window:
        rows = slice(*_pixels(box.top - margin, box.bottom + margin, height))
        return rows, slice(*_pixels(box.left - margin, box.right + margin, width))

    boxes = _divided(asked, _Box(0, 0, *asked.shape))
    return [Tile(window(box, 0), window(box, CONTEXT_BLOCKS)) for box in boxes]


def _pixels(first: int, last: int, size: int) -> tuple[int, int]:
    """Pixels of some blocks that lie in the image."""
    return max(first * BLOCK_PX, 0), min(last * BLOCK_PX, size)


def _blocks(where: Mask) -> Mask:
    """Blocks with a marked pixel."""
    height, width = where.shape
    whole = cv2.copyMakeBorder(
        where.view(np.uint8), 0, -height % BLOCK_PX, 0, -width % BLOCK_PX, cv2.BORDER_CONSTANT
    )
    size = whole.shape[1] // BLOCK_PX, whole.shape[0] // BLOCK_PX
    means = cv2.resize(whole.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(means > 0)


def _divided(asked: Mask, box: _Box) -> Iterator[_Box]:
    """Cover the asked blocks of a box by boxes, cut in two wherever that takes less time."""
    part = asked[box.top : box.bottom, box.left : box.right]
    rows, columns = (np.flatnonzero(part.any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return
    box = _Box(
        box.top + int(rows[0]),
        box.left + int(columns[0]),
        box.top + int(rows[-1]) + 1,
        box.left + int(columns[-1]) + 1,
    )
    part = asked[box.top : box.bottom, box.left : box.right]
    by_rows, by_columns = _costs_of_cuts(part), _costs_of_cuts(part.T)
    whole = _cost(*part.shape)
    if min(by_rows.min(initial=whole), by_columns.min(initial=whole)) >= whole:
        yield box
    elif by_rows.min(initial=whole) <= by_columns.min(initial=whole):
        cut = box.top + int(by_rows.argmin()) + 1
        yield from _divided(asked, box._replace(bottom=cut))
        yield from _divided(asked, box._replace(top=cut))
    else:
        cut = box.left + int(by_columns.argmin()) + 1
        yield from _divided(asked, box._replace(right=cut))
        yield from _divided(asked, box._replace(left=cut))


def _cost(height: int, width: int) -> int:
    """Time that a box takes, in blocks."""
    return (height + 2 * CONTEXT_BLOCKS) * (width + 2 * CONTEXT_BLOCKS) + CALL_BLOCKS


def _costs_of_cuts(part: Mask) -> NDArray[np.intp]:
    """Time of both halves for a cut after each row but the last. The first and last are marked."""
    return _costs_of_first_rows(part)[:-1] + _costs_of_first_rows(part[::-1])[-2::-1]


def _costs_of_first_rows(part: Mask) -> NDArray[np.intp]:
    """Time of the box around the marked blocks of the first row, the first two, and so on."""
    marked = np.logical_or.accumulate(part, axis=0)
    width = part.shape[1] - marked.argmax(axis=1) - marked[:, ::-1].argmax(axis=1)
    numbers = np.arange(1, len(part) + 1)
    height = np.maximum.accumulate(np.where(part.any(axis=1), numbers, 0))
    around = 2 * CONTEXT_BLOCKS
    return np.asarray((height + around) * (width + around) + CALL_BLOCKS)
