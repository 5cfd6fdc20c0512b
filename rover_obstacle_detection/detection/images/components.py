"""Connected components of a mask: their height, their size and their holes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def components(
    mask: NDArray[np.bool_],
) -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """Find the 8-connected components of a mask.

    Most masks mark few pixels, so that lists of them are faster than images.

    Parameters
    ----------
    mask : ndarray of bool, shape (height, width)

    Returns
    -------
    pixels : ndarray of int, shape (n,)
        Flat indices of the marked pixels, ascending.
    owner : ndarray of int, shape (n,)
        Component of each, from 0.
    count : int
        Number of components.
    """
    count, labels = cv2.connectedComponents(mask.view(np.uint8), connectivity=8)
    pixels = np.flatnonzero(mask)
    return pixels, labels.ravel()[pixels].astype(np.intp) - 1, count - 1


def runs(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the horizontal runs of marked pixels.

    Parameters
    ----------
    mask : ndarray of bool, shape (height, width)

    Returns
    -------
    first, last : ndarray of int, shape (n,)
        Flat indices of the pixels at both ends of each run, row by row.
    """
    starts, ends = mask.copy(), mask.copy()
    starts[:, 1:] &= ~mask[:, :-1]
    ends[:, :-1] &= ~mask[:, 1:]
    return np.flatnonzero(starts), np.flatnonzero(ends)


def marked(shape: tuple[int, ...], pixels: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return a mask of the given flat indices."""
    mask = np.zeros(shape, np.bool_)
    mask.ravel()[pixels] = True
    return mask


def rows_of_components(
    row: NDArray[np.intp], owner: NDArray[np.intp], count: int
) -> NDArray[np.intp]:
    """Count the rows from the first pixel of each component to its last.

    Parameters
    ----------
    row : ndarray of int, shape (n,)
        Of each pixel, ascending.
    owner : ndarray of int, shape (n,)
        Component of each pixel, from 0.
    count : int
        Number of components, each with a pixel.
    """
    top, bottom = np.zeros(count, np.intp), np.zeros(count, np.intp)
    # The last of several values is kept.
    top[owner[::-1]], bottom[owner] = row[::-1], row
    return bottom - top + 1


def top_heights(
    height_m: NDArray[np.float32], parts: NDArray[np.int32], share: float
) -> NDArray[np.float32]:
    """Average the highest pixels of each component.

    Parameters
    ----------
    height_m : ndarray of float32, shape (height, width)
        Metres.
    parts : ndarray of int32, shape (height, width)
        Component of each pixel; 0 is none.
    share : float
        Share of a component's pixels that are averaged, at least one pixel.

    Returns
    -------
    ndarray of float32, shape (components + 1,)
        Metres; 0 for components without a pixel.
    """
    inside = np.flatnonzero(parts > 0)
    number = parts.ravel()[inside].astype(np.intp)
    height = height_m.ravel()[inside].astype(np.float64)
    tops = np.zeros(int(parts.max(initial=0)) + 1, np.float32)
    if not inside.size:
        return tops
    count = np.bincount(number, minlength=tops.size)
    first = np.cumsum(count) - count
    # One key per pixel sorts by component, then by descending height.
    span = 1 + height.max() - height.min()
    highest = number * span + (height.max() - height)
    highest.sort()
    highest = height.max() - (highest - np.repeat(np.arange(tops.size), count) * span)
    running = np.concatenate(([0.0], np.cumsum(highest)))
    found = np.flatnonzero(count)
    averaged = np.maximum((count[found] * share).astype(np.intp), 1)
    tops[found] = (running[first[found] + averaged] - running[first[found]]) / averaged
    return tops


def small_parts(mask: NDArray[np.bool_], min_pixels: int) -> NDArray[np.bool_]:
    """Find the 8-connected components with fewer than ``min_pixels`` pixels.

    Parameters
    ----------
    mask : ndarray of bool, shape (height, width)
    min_pixels : int

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    if not mask.any():
        return np.zeros_like(mask)
    pixels, owner, _ = components(mask)
    return marked(mask.shape, pixels[(np.bincount(owner) < min_pixels)[owner]])


def parts_with(seeds: NDArray[np.bool_], mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Keep the 8-connected components that have a seed.

    Parameters
    ----------
    seeds, mask : ndarray of bool, shape (height, width)

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    if not mask.any():
        return mask
    pixels, owner, count = components(mask)
    kept = np.bincount(owner[seeds.ravel()[pixels]], minlength=count) > 0
    return marked(mask.shape, pixels[kept[owner]])


def high_holes(
    mask: NDArray[np.bool_], height_m: NDArray[np.float32], min_height_m: float
) -> NDArray[np.bool_]:
    """Find the holes of a mask that are part of the obstacle, as they are high themselves.

    Parameters
    ----------
    mask : ndarray of bool, shape (height, width)
    height_m : ndarray of float32, shape (height, width)
        Metres; no NaN.
    min_height_m : float
        Mean height above which a hole is filled.

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    A hole is a 4-connected component of the background that does not touch the image border.
    """
    holes = np.zeros_like(mask)
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    # What is around the marked pixels reaches the border as well.
    window = np.s_[max(0, top - 1) : top + height + 1, max(0, left - 1) : left + width + 1]
    count, labels = cv2.connectedComponents((~mask[window]).view(np.uint8), connectivity=4)
    inner = np.ones(count, np.bool_)
    inner[0] = False
    for side in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        inner[side] = False
    if not inner.any():
        return holes
    where = np.asarray(inner.take(np.asarray(labels)), np.bool_)
    owner = labels[where]
    pixels = np.bincount(owner, minlength=count)
    sums = np.bincount(owner, weights=height_m[window][where], minlength=count)
    holes[window][where] = (sums > min_height_m * pixels)[owner]
    return holes
