"""Draw a detection: the overlay and the study's intermediate steps.

Every picture is an 8-bit BGR image aligned with the left image.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rover_obstacle_detection.detection.result.cue import KIND_NUMBERS, Kind
from rover_obstacle_detection.detection.result.detection import OBSTACLE, Detection
from rover_obstacle_detection.detection.result.obstacles import Obstacle

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

BLACK: Colour = (0, 0, 0)
WHITE: Colour = (255, 255, 255)
RED: Colour = (48, 16, 240)
TEAL: Colour = (168, 178, 36)
ORANGE: Colour = (32, 140, 245)
MAGENTA: Colour = (210, 40, 200)
YELLOW: Colour = (40, 215, 245)
BLUE: Colour = (250, 120, 30)
GREEN: Colour = (60, 190, 70)
DARK_GREY: Colour = (72, 72, 72)
LIGHT_GREY: Colour = (150, 150, 150)

KIND_COLOURS: Mapping[Kind, Colour] = {
    'rock': RED,
    'slope': YELLOW,
    'drop': MAGENTA,
    'unmeasured': BLUE,
    'rough': GREEN,
}
"""Colours of obstacles by their kind."""

MAX_LABELS = 8
"""Labels of an overlay. Of many obstacles, more labels would hide the others."""

# Log scale of the roughness and step map: from stereo noise to far above any clearance.
ROUGHNESS_STEP_RANGE_M = (0.001, 1.0)
# Grey levels of that scale; the lowest stays apart from the black of missing values.
_SCALE_LEVELS = (24.0, 255.0)
# Percentiles that the disparity colours span, so that outliers do not stretch them.
_DISPARITY_PERCENTILES = (0.5, 99.5)
# Consecutive multiples of the golden ratio conjugate, modulo 1, are far apart.
_GOLDEN_RATIO_CONJUGATE = 0.61803398875
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def disparity_picture(detection: Detection) -> Picture:
    """Draw the disparity from far (blue) to near (red); black without a match."""
    disparity = detection.disparity
    valid = disparity > 0
    lowest, highest = disparity_limits(detection)
    scaled = (disparity - lowest) * (255.0 / max(highest - lowest, 1e-6))
    picture = cv2.applyColorMap(_to_uint8(scaled), cv2.COLORMAP_TURBO)
    picture[~valid] = BLACK
    return _picture(picture)


def height_picture(detection: Detection) -> Picture:
    """Draw the height above the local ground: level green, low blue, high red; black without 3D.

    The colours end at `height_limit_m` below and above the ground.
    """
    known = np.isfinite(detection.height)
    limit_m = height_limit_m(detection)
    height = np.where(known, detection.height, 0.0)
    scaled = (height / limit_m + 1.0) * 127.5
    picture = cv2.applyColorMap(_to_uint8(scaled), cv2.COLORMAP_TURBO)
    picture[~known] = BLACK
    return _picture(picture)


def height_limit_m(detection: Detection) -> float:
    """Return the height at which the colours of `height_picture` end."""
    return 2 * detection.config.max_step


def disparity_limits(detection: Detection) -> tuple[float, float]:
    """Return the smallest and largest disparity in pixels, without outliers; (0, 1) if none."""
    valid = detection.disparity[detection.disparity > 0]
    if not valid.size:
        return 0.0, 1.0
    lowest, highest = np.percentile(valid, _DISPARITY_PERCENTILES)
    return float(lowest), float(highest)


def regions_picture(detection: Detection) -> Picture:
    """Draw each mean-shift region in its own hue and mean brightness, with a dark outline."""
    regions = detection.regions
    count = int(regions.max()) + 1
    pixels = np.bincount(regions.ravel(), minlength=count)
    grey = np.bincount(regions.ravel(), weights=detection.grey.ravel(), minlength=count)
    brightness = 70.0 + 0.7 * grey / np.maximum(pixels, 1)
    hue = np.arange(count) * _GOLDEN_RATIO_CONJUGATE % 1.0 * 180.0
    colours = np.stack((hue, np.full(count, 130.0), brightness), axis=-1)
    palette = cv2.cvtColor(_to_uint8(colours)[np.newaxis], cv2.COLOR_HSV2BGR)[0]
    picture = palette[regions]
    picture[_borders(regions)] = (24, 24, 24)
    return _picture(picture)


def seeds_picture(detection: Detection) -> Picture:
    """Draw seed regions, which have enough 3D points, in teal and all others in orange."""
    seeds = detection.seeds
    grey = _as_bgr(detection.grey)
    picture = _tinted(grey, seeds, TEAL, 0.45)
    picture = _tinted(picture, ~seeds, ORANGE, 0.75)
    picture[_borders(detection.regions)] //= 2
    return picture


def roughness_step_picture(detection: Detection) -> Picture:
    """Draw roughness plus elevation step on a log scale, 1 mm dark to 1 m bright; black: none."""
    low, high = (math.log10(limit) for limit in ROUGHNESS_STEP_RANGE_M)
    total = detection.roughness + detection.step
    known = np.isfinite(total)
    safe = np.where(known, np.maximum(total, ROUGHNESS_STEP_RANGE_M[0]), 1.0)
    dark, bright = _SCALE_LEVELS
    scaled = dark + (np.log10(safe) - low) / (high - low) * (bright - dark)
    picture = cv2.applyColorMap(_to_uint8(scaled), cv2.COLORMAP_INFERNO)
    picture[~known] = BLACK
    return _picture(picture)


def mask_picture(detection: Detection) -> Picture:
    """Draw the obstacle mask: white obstacle, black free, grey unknown."""
    picture = np.zeros((*detection.mask.shape, 3), np.uint8)
    picture[~detection.known] = DARK_GREY
    picture[detection.mask == OBSTACLE] = WHITE
    return picture


def overlay_picture(detection: Detection, image: NDArray[Any] | None = None) -> Picture:
    """Draw the detection over the left image.

    Obstacles are outlined in the colour of their kind. The nearest and the tallest are labelled
    with kind, height above the ground where that makes them obstacles, and distance. Within them,
    each pixel has the colour of its own kind. Unknown pixels are hatched. The rest of the image is
    free.

    Parameters
    ----------
    detection : Detection
    image : ndarray, shape (height, width) or (height, width, 3), optional
        The detector's left image, grey or BGR. If omitted or not 8-bit, the detection's own grey
        image is used.
    """
    picture = _as_bgr(detection.grey if image is None or image.dtype != np.uint8 else image)
    obstacle = detection.mask == OBSTACLE
    picture = _hatched(picture, ~detection.known & ~obstacle)
    for kind, part in pixels_by_kind(detection).items():
        picture = _tinted(picture, part, KIND_COLOURS[kind], 0.4)
    for kind in {each.kind for each in detection.obstacles}:
        _outline(picture, _of_kind(detection, kind), KIND_COLOURS[kind])
    _label(picture, detection)
    return picture


PICTURES: Mapping[str, Callable[[Detection], Picture]] = {
    'disparity': disparity_picture,
    'regions': regions_picture,
    'seeds': seeds_picture,
    'roughness_step': roughness_step_picture,
    'obstacle_map': mask_picture,
}
"""The study's pictures by name, in the order of its steps."""


def shown_obstacles(detection: Detection) -> tuple[Obstacle, ...]:
    """Return the obstacles; their height is NaN if no ground was found to measure it from."""
    if detection.ground.measured:
        return detection.obstacles
    return tuple(replace(each, max_height_m=math.nan) for each in detection.obstacles)


def pixels_by_kind(detection: Detection) -> dict[Kind, NDArray[np.bool_]]:
    """Return the obstacle pixels of each kind that a detection has."""
    parts = {kind: detection.kinds == KIND_NUMBERS[kind] for kind in KIND_COLOURS}
    return {kind: part for kind, part in parts.items() if part.any()}


def obstacle_label(obstacle: Obstacle, max_step_m: float) -> str:
    """Return an obstacle's kind, height and distance, such as ``rock 21 cm @ 1.4 m``.

    The height is shown only where it makes an obstacle: see `height_counts`.
    """
    if not math.isfinite(obstacle.range_m):
        return 'no 3D' if obstacle.kind == 'unmeasured' else f'{obstacle.kind}, no 3D'
    height = ''
    if height_counts(obstacle, max_step_m):
        height = f'{100 * obstacle.max_height_m:.0f} cm '
    return f'{obstacle.kind} {height}@ {obstacle.range_m:.1f} m'


def by_importance(obstacles: Sequence[Obstacle], max_step_m: float) -> list[Obstacle]:
    """Sort obstacles: the nearest, the tallest, the second nearest, the second tallest, and so on.

    Only measured heights that make an obstacle count: see `height_counts`.
    """
    nearest = sorted(
        obstacles, key=lambda each: each.range_m if math.isfinite(each.range_m) else math.inf
    )
    tallest = sorted(
        (each for each in obstacles if height_counts(each, max_step_m)),
        key=lambda each: -each.max_height_m,
    )
    in_turn = itertools.chain.from_iterable(itertools.zip_longest(nearest, tallest))
    return [each for each in dict.fromkeys(in_turn) if each is not None]


def height_counts(obstacle: Obstacle, max_step_m: float) -> bool:
    """Whether an obstacle is one because of its measured height.

    Slopes and drops are obstacles at any height, and distant rocks by their size in the image.
    """
    return obstacle.kind == 'rock' and obstacle.max_height_m >= max_step_m


def _of_kind(detection: Detection, kind: Kind) -> NDArray[np.bool_]:
    """Pixels of the obstacles of a kind."""
    same = np.array([False, *(each.kind == kind for each in detection.obstacles)])
    return np.asarray(same[detection.obstacle_numbers])


def _as_bgr(image: NDArray[Any]) -> Picture:
    return _picture(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy())


def _hatched(picture: Picture, where: NDArray[np.bool_]) -> Picture:
    """Dim the marked pixels and draw diagonal lines over them."""
    height, width = where.shape
    period = max(8, height // 48)
    line = np.arange(height + width) % period < max(1, period // 6)
    dimmed = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) // 2
    dimmed[sliding_window_view(line, width)[:height]] = LIGHT_GREY[0]
    return _picture(cv2.copyTo(_as_bgr(dimmed), where.astype(np.uint8), picture))


def _tinted(
    picture: Picture, where: NDArray[np.bool_], colour: Colour, strength: float
) -> Picture:
    levels = np.repeat(np.arange(256, dtype=np.uint8), 3).reshape(1, 256, 3)
    blended = cv2.addWeighted(levels, 1.0 - strength, np.full_like(levels, colour), strength, 0.0)
    return _picture(cv2.copyTo(cv2.LUT(picture, blended), where.astype(np.uint8), picture))


def _outline(picture: Picture, mask: NDArray[np.bool_], colour: Colour) -> None:
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    thickness = max(1, round(picture.shape[0] / 384))
    cv2.drawContours(picture, contours, -1, BLACK, thickness + 2, cv2.LINE_AA)
    cv2.drawContours(picture, contours, -1, colour, thickness, cv2.LINE_AA)


def _label(picture: Picture, detection: Detection) -> None:
    """Label the nearest and the tallest obstacles, where the label overlaps no other one."""
    scale = max(0.35, picture.shape[0] / 1600.0)
    speck_pixels = picture.shape[0] * picture.shape[1] // 8000
    taken: list[tuple[int, int, int, int]] = []
    max_step_m = detection.config.max_step
    large = [each for each in shown_obstacles(detection) if each.pixels >= speck_pixels]
    for obstacle in by_importance(large, max_step_m):
        if len(taken) == MAX_LABELS:
            break
        text = obstacle_label(obstacle, max_step_m)
        (width, height), below = cv2.getTextSize(text, _FONT, scale, 1)
        left = obstacle.left + (obstacle.width - width) // 2
        left = max(2, min(left, picture.shape[1] - width - 3))
        top = obstacle.top - height - below - 4
        # Obstacles at the upper border have their label inside.
        top = max(top, 4)
        box = (left - 2, top - 2, left + width + 2, top + height + below + 1)
        if any(_overlap(box, other) for other in taken):
            continue
        taken.append(box)
        backdrop = picture[max(box[1], 0) : box[3], max(box[0], 0) : box[2]]
        backdrop //= 4
        cv2.putText(picture, text, (left, top + height), _FONT, scale, WHITE, 1, cv2.LINE_AA)


def _overlap(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _borders(regions: NDArray[np.int32]) -> NDArray[np.bool_]:
    borders = np.zeros(regions.shape, np.bool_)
    borders[:, 1:] |= regions[:, 1:] != regions[:, :-1]
    borders[1:] |= regions[1:] != regions[:-1]
    return borders


def _to_uint8(values: NDArray[Any]) -> Picture:
    rounded: Picture = np.clip(np.rint(values), 0, 255).astype(np.uint8)
    return rounded


def _picture(array: NDArray[Any]) -> Picture:
    # OpenCV's type hints declare Mat, not an 8-bit array.
    picture: Picture = np.asarray(array, np.uint8)
    return picture
