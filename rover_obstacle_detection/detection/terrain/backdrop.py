"""The backdrop: what is seen past the end of the ground, such as sky and far hills."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.components import components, marked
from rover_obstacle_detection.detection.images.texture import untextured
from rover_obstacle_detection.detection.stereo.matching import Stereo
from rover_obstacle_detection.detection.terrain.brim_parameters import BackdropParameters
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters

Mask = NDArray[np.bool_]
T = TypeVar('T', bound=np.generic)


def with_backdrop(stereo: Stereo, excluded: Mask | None, parameters: TerrainParameters) -> Stereo:
    """Place what is seen past the end of the ground at the greatest distance.

    There it lies far below the ground that hides its foot, so that the end of the ground shows as
    a brim.

    Parameters
    ----------
    stereo : Stereo
    excluded : ndarray of bool, shape (height, width), optional
        Pixels that show the rover or nothing. The frame's own also has what is out of range.
    parameters : TerrainParameters

    Returns
    -------
    Stereo
        What is matched beyond ``max_range_m``, and sky where ground could be seen, lies just
        within it. Sky has no noise.
    """
    farthest = np.float32(1.0001 * stereo.frame.camera.disparity_at(parameters.max_range_m))
    sky = sky_in_place_of_ground(stereo, excluded, parameters.backdrop)
    beyond = (stereo.disparity > 0) & (stereo.disparity < farthest)
    return replace(
        stereo,
        disparity=np.where(sky | beyond, farthest, stereo.disparity),
        noise_px=np.where(sky, np.float32(0), stereo.noise_px),
    )


def sky_in_place_of_ground(
    stereo: Stereo, excluded: Mask | None, parameters: BackdropParameters
) -> Mask:
    """Find the sky where the ground plane would be seen.

    Sky reaches down to an edge, plain and evenly bright: from above the horizon or, where that is
    not in view, from the top of the image.

    Parameters
    ----------
    stereo : Stereo
    excluded : ndarray of bool, shape (height, width), optional
        See `with_backdrop`.
    parameters : BackdropParameters

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    Ground may be plain too. Matching finds some of it, but hardly any sky. In haze and where the
    sensor saturates, ground becomes plain gradually, in the brightness of the sky. Black shadow
    may reach to the horizon, so black sky does not count.
    """
    p, left = parameters, stereo.frame.pair[0]
    noise = p.noises * stereo.grey_noise / math.sqrt(2)
    plain = untextured(left, p.window_px, max(p.min_difference, noise))
    above = (stereo.expected <= 0) | _top(excluded, left.shape, p.window_px)
    if excluded is not None:
        plain &= ~excluded
    brightness = np.asarray(cv2.blur(left, (p.window_px,) * 2), np.float32)
    # What the lowest window above the horizon shows.
    lowest_row = np.count_nonzero(above, axis=0) - 1 - p.window_px // 2
    of_sky = _at_rows(brightness, lowest_row)
    of_sky[~_at_rows(plain, lowest_row) | (of_sky < p.min_grey)] = np.inf
    like_sky = plain & (np.abs(brightness - of_sky) < p.max_difference)
    # A column's sky ends with its first pixel that is none.
    sky = np.logical_and.accumulate(above | like_sky, axis=0)
    # No plain window reaches over the edge: the next one lies behind it.
    after = _at_rows(brightness, np.count_nonzero(sky, axis=0) + p.window_px)
    sky &= ~above & (np.abs(after - of_sky) > p.min_edge)
    return _unmatched_parts(sky, stereo.disparity > 0, p.max_matched_share)


def _top(excluded: Mask | None, shape: tuple[int, int], rows: int) -> Mask:
    """Mark the first rows that show something: those below an empty border and its rim."""
    numbers = np.arange(shape[0])[:, np.newaxis]
    if excluded is None:
        return np.broadcast_to(numbers < rows, shape)
    empty = np.count_nonzero(np.logical_and.accumulate(excluded, axis=0), axis=0)
    return np.asarray(numbers < rows + empty + (empty > 0))


def _unmatched_parts(mask: Mask, matched: Mask, max_share: float) -> Mask:
    """Keep the connected parts of a mask of which little is matched."""
    if not mask.any():
        return mask
    pixels, owner, count = components(mask)
    share = np.bincount(owner, matched.ravel()[pixels], count) / np.bincount(owner)
    return marked(mask.shape, pixels[share[owner] < max_share])


def _at_rows(image: NDArray[T], rows: NDArray[np.intp]) -> NDArray[T]:
    """Return the value of each column at a row of its own, or the nearest in the image."""
    rows = np.clip(rows, 0, len(image) - 1)
    return np.asarray(np.take_along_axis(image, rows[np.newaxis], axis=0)[0])
