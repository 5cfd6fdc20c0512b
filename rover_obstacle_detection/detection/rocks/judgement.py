"""Which outlined parts the rover cannot step over."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.components import high_holes
from rover_obstacle_detection.detection.rocks.parameters import RockParameters
from rover_obstacle_detection.detection.rocks.standing import Standing
from rover_obstacle_detection.detection.terrain.terrain import Terrain

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
    smooth_m = np.asarray(cv2.blur(np.nan_to_num(terrain.height_m, nan=0.0), (3, 3)), np.float32)
    drawn = drawn | high_holes(drawn, smooth_m, parameters.hole_share * parameters.max_step_m)
    step_px = terrain.pixels_per_metre * np.float32(parameters.max_step_m)
    parts = _measured_parts(drawn, probability, terrain, step_px)
    high = _has_core(parts, smooth_m, terrain, step_px, parameters)
    small = parts.step_px < parameters.small_step_px
    high |= _looks_high(parts, smooth_m, terrain, parameters) & small
    high &= parts.measured >= parameters.min_measured_share * parts.pixels
    high[0] = False
    return np.asarray(high[parts.labels])


@dataclass(frozen=True, eq=False)
class _Parts:
    """The connected parts of a drawing and what each shows, by its label; 0 is the rest."""

    labels: NDArray[np.int32]
    drawn: Mask
    pixels: NDArray[np.int32]
    height_px: NDArray[np.int32]
    measured: NDArray[np.int64]
    step_px: NDArray[np.float64]
    probability: NDArray[np.float64]

    def count(self, where: Mask) -> NDArray[np.int64]:
        """Count the marked pixels of each part."""
        return _count(self.labels, self.drawn & where, len(self.pixels))


def _measured_parts(drawn: Mask, probability: Image, terrain: Terrain, step_px: Image) -> _Parts:
    count, numbers, boxes, _ = cv2.connectedComponentsWithStats(
        drawn.astype(np.uint8), connectivity=8
    )
    labels = np.asarray(numbers, np.int32)
    return _Parts(
        labels,
        drawn,
        pixels=np.asarray(boxes[:, cv2.CC_STAT_AREA], np.int32),
        height_px=np.asarray(boxes[:, cv2.CC_STAT_HEIGHT], np.int32),
        measured=_count(labels, drawn & terrain.measured, count),
        step_px=_mean(labels, drawn & terrain.measured, step_px, count),
        probability=_mean(labels, drawn, probability, count),
    )


_MAX_NOISE_M = np.float32(1e6)


def _count(labels: NDArray[np.int32], where: Mask, count: int) -> NDArray[np.int64]:
    return np.bincount(labels[where], minlength=count)


def _mean(
    labels: NDArray[np.int32], where: Mask, values: Image, count: int
) -> NDArray[np.float64]:
    inside = labels[where]
    total = np.bincount(inside, weights=values[where], minlength=count)
    return np.asarray(total / np.maximum(np.bincount(inside, minlength=count), 1))


def _has_core(
    parts: _Parts, smooth_m: Image, terrain: Terrain, step_px: Image, p: RockParameters
) -> Mask:
    """Parts that rise above step and noise somewhere, and mostly stand up."""
    seen_share = np.clip(step_px / p.full_step_px, p.min_seen_share, 1)
    # Without 3D the noise is infinite; times 0 it would not be a number.
    noise_m = p.core_noises * np.minimum(terrain.noise_m, _MAX_NOISE_M)
    core_m = np.maximum(p.core_share * seen_share * p.max_step_m, noise_m)
    stands = parts.count(terrain.measured & (smooth_m > p.min_standing_m))
    has_core = parts.count(smooth_m > core_m) >= p.min_core_pixels
    return has_core & (stands >= p.standing_share * parts.measured)


def _looks_high(parts: _Parts, smooth_m: Image, terrain: Terrain, p: RockParameters) -> Mask:
    """Parts that very likely are rocks and look as high as the step, if stereo allows for it."""
    likely = (parts.probability >= p.accepted_probability) & (parts.height_px >= parts.step_px)
    apparent_m = p.max_step_m * parts.height_px / np.maximum(parts.step_px, 1e-3)
    least_m = np.maximum(p.min_seen_share * p.max_step_m, p.apparent_share * apparent_m)
    most_m = smooth_m + p.possible_noises * terrain.noise_m
    possible = terrain.measured & (most_m > least_m.astype(np.float32)[parts.labels])
    return np.asarray(likely & (parts.count(possible) >= p.possible_share * parts.measured))


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
    quiet = terrain.noise_m < p.certain_noise_share * p.max_step_m
    high = terrain.measured & quiet & (terrain.height_m > p.certain_share * p.max_step_m)
    count = len(standing.top_m)
    pixels = np.bincount(standing.parts[high], minlength=count)
    found = np.bincount(standing.parts[high & drawn], minlength=count)
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
    height_m = np.nan_to_num(terrain.height_m, nan=0.0)
    kernel = np.zeros((2 * reach_px + 1,) * 2, np.uint8)
    kernel[reach_px:] = 1
    beside_m = cv2.dilate(height_m, kernel)
    return np.asarray((standing.parts > 0) & (height_m > 0.5 * beside_m))
