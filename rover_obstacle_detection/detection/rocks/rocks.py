"""What stands in the way: the outlines of rocks, and which of them are too high."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.components import high_holes
from rover_obstacle_detection.detection.rocks.outline_features import (
    PARALLAX_PLANES,
    outline_planes,
)
from rover_obstacle_detection.detection.rocks.outline_model import outline_model
from rover_obstacle_detection.detection.stereo.ground_matching import Stereo
from rover_obstacle_detection.detection.terrain.hazards import (
    FOOT_M,
    FOOT_SHARE,
    MIN_CORE_PIXELS,
    Standing,
)
from rover_obstacle_detection.detection.terrain.survey import Terrain

# The filter halves the resolution three times, and sees little that is farther than three blocks.
BLOCK = 8
MARGIN_BLOCKS = 3
HOLE_SHARE = 0.5
STANDING_SHARE = 0.3
FULL_STEP_PX = 20.0
LEAST_SEEN_SHARE = 0.7
# Stereo's height is worse with the square of the distance, the size in the image only with it.
SMALL_STEP_PX = 10.0
SURE_PROBABILITY = 0.7
POSSIBLE_NOISES = 3.0
POSSIBLE_SHARE = 0.1
APPARENT_SHARE = 0.2
UNMEASURED_PX = 9
CERTAIN_SHARE = 1.5
CERTAIN_NOISE_SHARE = 0.15
CERTAIN_PIXELS = 40
DRAWN_SHARE = 0.9
UPRIGHT_RATIO = 1.5


@dataclass(frozen=True, eq=False)
class Rocks:
    """What the rover cannot step over.

    Parameters
    ----------
    high : ndarray of bool, shape (height, width)
        For its height, or far away its size.
    by_sight : ndarray of bool, shape (height, width)
        For its looks and its size in the image: there is no 3D.
    probability : ndarray of float32, shape (height, width)
        Of the outline filter; NaN where it was not asked, 1 where it may not deny.
    """

    high: NDArray[np.bool_]
    by_sight: NDArray[np.bool_]
    probability: NDArray[np.float32]


def outlined_rocks(
    stereo: Stereo,
    terrain: Terrain,
    standing: Standing,
    camera: StereoCamera,
    config: DetectorConfig,
    rover_mask: NDArray[np.bool_] | None = None,
    leave_out: frozenset[str] = frozenset(),
) -> Rocks:
    """Draw the outlines of what stands higher above the local ground than the rover can step.

    Parameters
    ----------
    stereo : Stereo
    terrain : Terrain
    standing : Standing
    camera : StereoCamera
    config : DetectorConfig
    rover_mask : ndarray of bool, shape (height, width), optional
        Pixels that show the rover: no ground that lacks 3D.
    leave_out : frozenset of str
        Without ``outlines`` a threshold at half the height beside draws them; without ``parallax``
        the filter does not see that evidence; without ``sight`` only what stereo says counts.

    Notes
    -----
    Disparity blurs outlines by the size of its blocks, and the foot of a rock is as high as the
    ground. The filter sees height, noise and grey level together. What it draws is an
    obstacle only if it is too high for the rover (`too_high`), and what stands far over step and
    noise is one whatever the filter says.
    """
    shape = stereo.disparity.shape
    found = Rocks(
        np.zeros(shape, np.bool_), np.zeros(shape, np.bool_), np.full(shape, np.nan, np.float32)
    )
    unmeasured = ~terrain.measured & (stereo.expected > camera.disparity_at(config.max_range))
    if rover_mask is not None:
        unmeasured &= ~rover_mask
    kernel = np.ones((UNMEASURED_PX, UNMEASURED_PX), np.uint8)
    wide = cv2.erode(unmeasured.astype(np.uint8), kernel) > 0
    for window in windows_around((standing.parts > 0) | wide):
        parts = Standing(standing.parts[window], standing.top_m)
        near = _scaled(terrain.within(window), stereo.expected[window], unmeasured[window], camera)
        if 'outlines' not in leave_out:
            planes = outline_planes(stereo, terrain, standing, camera, config, window)
            if 'parallax' in leave_out:
                planes[list(PARALLAX_PLANES)] = 0
            probability = outline_model().probability(planes)
            drawn = probability > config.outline_probability
            denied = denied_parts(drawn, near, parts, config)
            drawn |= denied
            seen = found.probability[window]
            np.fmax(seen, np.where(denied, 1, probability), out=seen)
        else:
            drawn = half_height_outlines(near, parts)
            probability = np.zeros(drawn.shape, np.float32)
        if 'sight' in leave_out:
            probability = np.zeros_like(probability)
        high, by_sight = too_high(drawn, probability, near, unmeasured[window], config)
        found.high[window] |= high
        found.by_sight[window] |= by_sight
    return found


def _scaled(
    terrain: Terrain,
    expected: NDArray[np.float32],
    unmeasured: NDArray[np.bool_],
    camera: StereoCamera,
) -> Terrain:
    """Give what is not measured the scale of the ground plane."""
    scale = terrain.pixels_per_metre.copy()
    scale[unmeasured] = expected[unmeasured] / np.float32(camera.baseline_m)
    return replace(terrain, pixels_per_metre=scale)


def too_high(
    drawn: NDArray[np.bool_],
    probability: NDArray[np.float32],
    terrain: Terrain,
    unmeasured: NDArray[np.bool_],
    config: DetectorConfig,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Keep the connected parts of a drawing that the rover cannot step over.

    Parameters
    ----------
    drawn : ndarray of bool, shape (height, width)
    probability : ndarray of float32, shape (height, width)
        How likely each pixel is to be on something too high, by all that the filter sees.
    terrain : Terrain
        With the scale of the ground plane where there is no 3D.
    unmeasured : ndarray of bool, shape (height, width)
        Pixels without 3D at which the ground plane lies within range.
    config : DetectorConfig

    Returns
    -------
    high, by_sight : ndarray of bool, shape (height, width)
        What is too high by stereo or, far away, its size; and what only looks so.

    Notes
    -----
    A part is kept for its core, about as high as the step and over the noise, if most of it stands
    up: a core may touch a false outline. Matching blocks flatten the tops of what is not much
    larger than they are, so less is asked of what is far. Farther still, where the step is a few
    pixels, its size in the image tells more than stereo, and where there is no 3D it is all there
    is: what surely looks like a rock, and as large as the step at that distance, is one, unless
    stereo rules it out: hardly a pixel could be that high, or a fifth as high as the part looks,
    within three standard deviations.
    """
    smooth_m = np.asarray(cv2.blur(np.nan_to_num(terrain.height_m, nan=0.0), (3, 3)), np.float32)
    drawn = drawn | high_holes(drawn, smooth_m, HOLE_SHARE * config.max_step)
    count, numbers, boxes, _ = cv2.connectedComponentsWithStats(
        drawn.astype(np.uint8), connectivity=8
    )
    labels = np.asarray(numbers, np.int32)
    step_px = terrain.pixels_per_metre * np.float32(config.max_step)
    parts = _Parts(
        labels,
        drawn,
        pixels=np.asarray(boxes[:, cv2.CC_STAT_AREA], np.int32),
        height_px=np.asarray(boxes[:, cv2.CC_STAT_HEIGHT], np.int32),
        measured=_count(labels, drawn & terrain.measured, count),
        blind=_count(labels, drawn & unmeasured, count),
        step_px=_mean(labels, drawn, step_px, count),
        likely=_mean(labels, drawn, probability, count),
    )
    high = _has_core(parts, smooth_m, terrain, step_px, config)
    looks_high = _looks_high(parts, smooth_m, terrain, config)
    high |= looks_high & (parts.step_px < SMALL_STEP_PX) & (parts.measured >= parts.pixels / 2)
    by_sight = looks_high & ~high & (parts.blind > parts.pixels / 2)
    high[0] = by_sight[0] = False
    return high[labels], by_sight[labels]


@dataclass(frozen=True, eq=False)
class _Parts:
    """The connected parts of a drawing, and what each shows, by its number; 0 is the rest."""

    labels: NDArray[np.int32]
    drawn: NDArray[np.bool_]
    pixels: NDArray[np.int32]
    height_px: NDArray[np.int32]
    measured: NDArray[np.int64]
    blind: NDArray[np.int64]
    step_px: NDArray[np.float64]
    likely: NDArray[np.float64]

    def count(self, where: NDArray[np.bool_]) -> NDArray[np.int64]:
        return _count(self.labels, self.drawn & where, len(self.pixels))


def _count(labels: NDArray[np.int32], where: NDArray[np.bool_], count: int) -> NDArray[np.int64]:
    return np.bincount(labels[where], minlength=count)


def _mean(
    labels: NDArray[np.int32], where: NDArray[np.bool_], values: NDArray[np.float32], count: int
) -> NDArray[np.float64]:
    inside = labels[where]
    total = np.bincount(inside, weights=values[where], minlength=count)
    return np.asarray(total / np.maximum(np.bincount(inside, minlength=count), 1))


def _has_core(
    parts: _Parts,
    smooth_m: NDArray[np.float32],
    terrain: Terrain,
    step_px: NDArray[np.float32],
    config: DetectorConfig,
) -> NDArray[np.bool_]:
    """Tell the parts that rise above step and noise somewhere, and stand up in good part."""
    seen_share = np.clip(step_px / FULL_STEP_PX, LEAST_SEEN_SHARE, 1)
    core_m = np.maximum(
        config.core_share * seen_share * config.max_step, config.core_noises * terrain.noise_m
    )
    foot_m = min(FOOT_M, FOOT_SHARE * config.max_step)
    stands = parts.count(terrain.measured & (smooth_m > foot_m))
    has_core = parts.count(smooth_m > core_m) >= MIN_CORE_PIXELS
    return has_core & (stands >= STANDING_SHARE * parts.measured)


def _looks_high(
    parts: _Parts, smooth_m: NDArray[np.float32], terrain: Terrain, config: DetectorConfig
) -> NDArray[np.bool_]:
    """Tell the parts that surely look like rocks as large as the step, if stereo allows it."""
    sure = (parts.likely >= SURE_PROBABILITY) & (parts.height_px >= parts.step_px)
    apparent_m = config.max_step * parts.height_px / np.maximum(parts.step_px, 1e-3)
    least_m = np.maximum(LEAST_SEEN_SHARE * config.max_step, APPARENT_SHARE * apparent_m)
    most_m = smooth_m + POSSIBLE_NOISES * terrain.noise_m
    possible = terrain.measured & (most_m > least_m.astype(np.float32)[parts.labels])
    return np.asarray(sure & (parts.count(possible) >= POSSIBLE_SHARE * parts.measured))


def denied_parts(
    drawn: NDArray[np.bool_], terrain: Terrain, standing: Standing, config: DetectorConfig
) -> NDArray[np.bool_]:
    """Find what stands so high over step and noise that the filter may not deny it.

    The filter has seen rocks, not the legs of a lander: what is upright. What is wider than high
    and not drawn is mostly ground that was taken for too low.
    """
    limit_m = CERTAIN_SHARE * config.max_step
    quiet = terrain.noise_m < CERTAIN_NOISE_SHARE * config.max_step
    high = terrain.measured & quiet & (terrain.height_m > limit_m)
    count = len(standing.top_m)
    pixels = np.bincount(standing.parts[high], minlength=count)
    found = np.bincount(standing.parts[high & drawn], minlength=count)
    certain = (pixels >= CERTAIN_PIXELS) & (found < DRAWN_SHARE * pixels)
    certain[0] = False
    if not certain.any():
        return np.zeros_like(drawn)
    return upright_parts(certain[standing.parts] & half_height_outlines(terrain, standing))


def upright_parts(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Keep the connected parts that are clearly higher than wide in the image."""
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    upright = boxes[:, cv2.CC_STAT_HEIGHT] >= UPRIGHT_RATIO * boxes[:, cv2.CC_STAT_WIDTH]
    upright[0] = False
    return np.asarray(upright[labels])


def windows_around(where: NDArray[np.bool_]) -> list[tuple[slice, slice]]:
    """Give windows of the image that hold all such pixels and what the filter sees around them.

    Parameters
    ----------
    where : ndarray of bool, shape (height, width)

    Returns
    -------
    list of tuple of two slices
        Rows and columns: of each group of pixels, or one that holds them all if that is less.
    """
    height, width = where.shape
    whole = cv2.copyMakeBorder(
        where.astype(np.uint8), 0, -height % BLOCK, 0, -width % BLOCK, cv2.BORDER_CONSTANT
    )
    blocks = whole.reshape(whole.shape[0] // BLOCK, BLOCK, -1, BLOCK).max(axis=(1, 3))
    kernel = np.ones((2 * MARGIN_BLOCKS + 1,) * 2, np.uint8)
    boxes = _boxes(np.asarray(cv2.dilate(blocks, kernel), np.uint8))
    if len(boxes) > 1:
        (top, left), (bottom, right) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1).sum()
        if area >= (bottom - top) * (right - left):
            boxes = np.array([[top, left, bottom, right]])
    boxes = np.minimum(boxes * BLOCK, [height, width] * 2)
    return [
        (slice(int(top), int(bottom)), slice(int(left), int(right)))
        for top, left, bottom, right in boxes
    ]


def _boxes(where: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Top, left, bottom and right of the connected parts."""
    _, _, boxes, _ = cv2.connectedComponentsWithStats(where, connectivity=8)
    left, top, width, height = boxes[1:, :4].T
    return np.stack((top, left, top + height, left + width), axis=1)


def half_height_outlines(terrain: Terrain, standing: Standing) -> NDArray[np.bool_]:
    """Cut off what is under half as high as what stands just below it in the image.

    Above and beside a rock, where disparity blurs, height falls over a few pixels to that of the
    ground far behind; at its foot it does so for good reason.
    """
    height_m = np.nan_to_num(terrain.height_m, nan=0.0)
    kernel = np.zeros((11, 11), np.uint8)
    kernel[5:] = 1
    beside_m = cv2.dilate(height_m, kernel)
    return np.asarray((standing.parts > 0) & (height_m > 0.5 * beside_m))
