"""Which outlined parts the rover cannot step over."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.components import (
    components,
    high_holes,
    marked,
    rows_of_components,
)
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.standing import Standing
from rover_obstacle_detection.detection.terrain.terrain import Terrain

_MAX_NOISE_M = np.float32(1e6)

Mask = NDArray[np.bool_]
Image = NDArray[np.float32]


def too_high(
    drawn: Mask, probability: Image, terrain: Terrain, parameters: RockParameters
) -> Mask:
    """Keep the connected parts of a drawing that the rover cannot step over.

    Parameters
    ----------
    drawn : ndarray of bool, shape (height, width)
    probability : ndarray of float32, shape (height, width)
        Probability that each pixel is on an obstacle.
    terrain : Terrain
    parameters : RockParameters

    Returns
    -------
    ndarray of bool, shape (height, width)
        Parts that are too high by stereo or, far away, too large in the image.

    Notes
    -----
    A part is kept if it has a core about as high as the step and above the noise. A good share of
    its measured pixels has to be raised, since a core may touch a false outline. Matching flattens
    rocks that are not much larger than its blocks, so that distant rocks may be lower.

    Where the step is only a few pixels high, apparent size replaces height. A part is kept if its
    mean probability is high, it appears as tall as the step, and a sufficient height is within a
    few standard deviations of what stereo measured.

    Looks alone make no obstacle: a part that is mostly not measured is unknown.
    """
    height_m = np.where(terrain.measured, terrain.height_m, np.float32(0))
    smooth_m = np.asarray(cv2.blur(height_m, (3, 3)), np.float32)
    drawn = drawn | high_holes(drawn, smooth_m, parameters.hole_share * parameters.max_step_m)
    pixels, owner, count = components(drawn)
    parts = _Parts(
        owner=owner,
        count=count,
        rows=rows_of_components(pixels // drawn.shape[1], owner, count),
        measured=terrain.measured[drawn],
        height_m=smooth_m[drawn],
        noise_m=terrain.noise_m[drawn],
        step_px=terrain.pixels_per_metre[drawn] * np.float32(parameters.max_step_m),
        probability=probability[drawn],
    )
    high = _has_core(parts, parameters) | _looks_high(parts, parameters)
    enough = parameters.min_measured_share * np.bincount(owner, minlength=count)
    high &= parts.counted(parts.measured) >= enough
    return marked(drawn.shape, pixels[high[owner]])


@dataclass(frozen=True, eq=False)
class _Parts:
    """The connected parts of a drawing, and what their n pixels show.

    Parameters
    ----------
    owner : ndarray of int, shape (n,)
        Part of each pixel, from 0.
    count : int
        Number of parts.
    rows : ndarray of int, shape (count,)
        Rows of the image that each covers.
    measured : ndarray of bool, shape (n,)
    height_m, noise_m, step_px, probability : ndarray of float32, shape (n,)
        Smoothed height and the noise of the height, metres; size of the step in the image;
        probability to be on an obstacle.
    """

    owner: NDArray[np.intp]
    count: int
    rows: NDArray[np.intp]
    measured: Mask
    height_m: Image
    noise_m: Image
    step_px: Image
    probability: Image

    def counted(self, where: Mask) -> NDArray[np.intp]:
        """Count the marked pixels of each part."""
        return np.bincount(self.owner[where], minlength=self.count)

    def mean(self, values: Image, where: Mask) -> NDArray[np.float64]:
        """Mean over the marked pixels of each part; 0 without any."""
        total = np.bincount(self.owner[where], weights=values[where], minlength=self.count)
        return np.asarray(total / np.maximum(self.counted(where), 1))


def _has_core(parts: _Parts, p: RockParameters) -> Mask:
    """Parts that rise above step and noise somewhere, and mostly stand up."""
    seen_share = np.clip(parts.step_px / p.full_step_px, p.min_seen_share, 1)
    # Without 3D the noise is infinite; times 0 it would not be a number.
    noise_m = p.core_noises * np.minimum(parts.noise_m, _MAX_NOISE_M)
    core_m = np.maximum(p.core_share * seen_share * p.max_step_m, noise_m)
    stands = parts.counted(parts.measured & (parts.height_m > p.min_standing_m))
    has_core = parts.counted(parts.height_m > core_m) >= p.min_core_pixels
    return has_core & (stands >= p.standing_share * parts.counted(parts.measured))


def _looks_high(parts: _Parts, p: RockParameters) -> Mask:
    """Small parts that likely are rocks and look as high as the step, if stereo allows for it."""
    measured = parts.measured
    step_px = parts.mean(parts.step_px, measured)
    small = step_px < p.small_step_px
    if not small.any():
        return small
    probability = parts.mean(parts.probability, np.ones_like(measured))
    likely = (probability >= p.accepted_probability) & (parts.rows >= step_px)
    apparent_m = p.max_step_m * parts.rows / np.maximum(step_px, 1e-3)
    least_m = np.maximum(p.min_seen_share * p.max_step_m, p.apparent_share * apparent_m)
    most_m = parts.height_m + p.possible_noises * parts.noise_m
    possible = parts.counted(measured & (most_m > least_m.astype(np.float32)[parts.owner]))
    allowed = possible >= p.possible_share * parts.counted(measured)
    return small & likely & allowed


def overruled_parts(
    drawn: Mask, terrain: Terrain, standing: Standing, parameters: RockParameters
) -> Mask:
    """Find parts so far above step and noise that they are obstacles whatever the network says.

    The network knows rocks, but not the upright legs of a lander. Parts that are wider than high
    are left to the network: they are mostly ground whose local ground is estimated too low.

    Parameters
    ----------
    drawn : ndarray of bool, shape (height, width)
        What the network outlined.
    terrain : Terrain
    standing : Standing
    parameters : RockParameters
    """
    p = parameters
    with np.errstate(invalid='ignore'):
        high = terrain.height_m > p.certain_share * p.max_step_m
    high &= terrain.noise_m < p.certain_noise_share * p.max_step_m
    owner = standing.parts[high]
    pixels = np.bincount(owner, minlength=len(standing.top_m))
    found = np.bincount(owner[drawn[high]], minlength=len(standing.top_m))
    certain = (pixels >= p.certain_pixels) & (found < p.drawn_share * pixels)
    certain[0] = False
    if not certain.any():
        return np.zeros_like(drawn)
    outlines = half_height_outlines(terrain, standing, p.half_height_reach_px)
    return upright_parts(certain[standing.parts] & outlines, p.upright_ratio)


def upright_parts(mask: Mask, min_ratio: float) -> Mask:
    """Keep the connected parts that are higher than wide in the image by a ratio."""
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    upright = boxes[:, cv2.CC_STAT_HEIGHT] >= min_ratio * boxes[:, cv2.CC_STAT_WIDTH]
    upright[0] = False
    return np.asarray(upright[labels])


def half_height_outlines(terrain: Terrain, standing: Standing, reach_px: int) -> Mask:
    """Cut off what is less than half as high as what stands just below it in the image.

    Matching blurs the rim of a rock: above and beside it, the height falls to that of the ground
    behind over a few pixels. The foot of a rock is really low, and is kept.
    """
    height_m = np.where(terrain.measured, terrain.height_m, np.float32(0))
    kernel = np.zeros((2 * reach_px + 1,) * 2, np.uint8)
    kernel[reach_px:] = 1
    beside_m = cv2.dilate(height_m, kernel)
    return np.asarray((standing.parts > 0) & (height_m > 0.5 * beside_m))
