"""The obstacles of a mask: their boxes in the image and in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.robust import quantile
from rover_obstacle_detection.detection.images.components import runs
from rover_obstacle_detection.detection.result.cue import KIND_NUMBERS, KINDS, Cue, Kind


@dataclass(frozen=True)
class Obstacle:
    """One connected obstacle.

    Parameters
    ----------
    left, top, width, height : int
        Bounding box in the left image, pixels.
    pixels : int
        Pixels of the mask.
    minimum_m, maximum_m : tuple of float
        Corners of the bounding box in the left optical frame, metres; NaN without 3D.
    max_height_m : float
        Greatest height above the local ground, metres; NaN without 3D.
    range_m : float
        Distance of its nearest part from the left camera, metres; NaN without 3D.
    confidence : float
        Confidence that this is an obstacle, 0 to 1.
    kind : str
        What it is, by the cue of most of its pixels: ``rock`` (anything that stands above the
        ground), ``slope``, ``drop``, ``rough``, or with method `study` ``unmeasured`` (it is dark
        and has hardly any 3D).

    Notes
    -----
    The measures in metres leave out a few per cent of the points at either end, since one false
    match would make a box as deep as the scene.
    """

    left: int
    top: int
    width: int
    height: int
    pixels: int
    minimum_m: tuple[float, float, float]
    maximum_m: tuple[float, float, float]
    max_height_m: float
    range_m: float
    confidence: float
    kind: Kind = 'rock'


@dataclass(frozen=True, eq=False)
class NumberedObstacles:
    """The connected obstacles of a mask, largest first.

    Parameters
    ----------
    image : ndarray of int32, shape (height, width)
        Number of each pixel's obstacle, 1 and up; 0 where there is none.
    boxes : ndarray of int32, shape (n, 5)
        Left, top, width, height and pixels of each.
    """

    image: NDArray[np.int32]
    boxes: NDArray[np.int32]


def number_obstacles(mask: NDArray[np.uint8]) -> NumberedObstacles:
    """Label the 8-connected obstacles of a mask, largest first.

    Parameters
    ----------
    mask : ndarray of uint8, shape (height, width)
        Not zero on obstacles.
    """
    count, components = cv2.connectedComponents(mask, connectivity=8)
    labels = np.asarray(components, np.int32)
    # OpenCV can measure the boxes, but takes several times as long as to find the components.
    first, last = runs(mask > 0)
    owner = labels.ravel()[first] - 1
    row, left, right = first // mask.shape[1], first % mask.shape[1], last % mask.shape[1]
    boxes = np.zeros((count - 1, 5), np.int32)
    boxes[:, :2] = mask.shape[::-1]
    for place, low, high in ((0, left, right), (1, row, row)):
        np.minimum.at(boxes[:, place], owner, low)
        np.maximum.at(boxes[:, place + 2], owner, high)
    boxes[:, 2:4] -= boxes[:, :2] - 1
    boxes[:, 4] = np.bincount(owner, weights=last - first + 1, minlength=count - 1)
    order = np.argsort(-boxes[:, 4], kind='stable')
    numbers = np.zeros(count, np.int32)
    numbers[order + 1] = np.arange(1, count)
    return NumberedObstacles(numbers.take(labels), boxes[order])


def describe_obstacles(
    numbered: NumberedObstacles,
    points: NDArray[np.float32],
    height_m: NDArray[np.float32],
    confidence: NDArray[np.float32],
    kinds: Sequence[Kind],
    tail_share: float,
) -> tuple[Obstacle, ...]:
    """Measure numbered obstacles.

    Parameters
    ----------
    numbered : NumberedObstacles
    points : ndarray of float32, shape (height, width, 3)
        Metres, NaN where none.
    height_m : ndarray of float32, shape (height, width)
        Above the local ground; NaN where none.
    confidence : ndarray of float32, shape (n,)
    kinds : sequence of str, n of them
    tail_share : float
        Share of the points at either end that the measures leave out.
    """
    judged = zip(numbered.boxes, confidence, kinds, strict=True)
    return tuple(
        _measure(number, box, numbered.image, points, height_m, float(each), kind, tail_share)
        for number, (box, each, kind) in enumerate(judged, start=1)
    )


def main_kinds(cue_shares: NDArray[np.float64]) -> tuple[Kind, ...]:
    """Name the kind of each obstacle after the cue of most of its pixels.

    Parameters
    ----------
    cue_shares : ndarray of float64, shape (n, cues)
        Share of each obstacle's pixels with each cue, in the order of `Cue`.

    Returns
    -------
    tuple of str
        Of cues with the same share, the first of `Cue` counts. Without any cue, which the study's
        morphology can leave, an obstacle is ``rough``.
    """
    of_cues = [KINDS[cue] for cue in Cue]
    return tuple(
        of_cues[int(np.argmax(shares))] if shares.any() else KINDS[Cue.ROUGHNESS_STEP]
        for shares in cue_shares
    )


def pixel_kinds(
    cues: NDArray[np.uint8], numbers: NDArray[np.int32], kinds: Sequence[Kind]
) -> NDArray[np.uint8]:
    """Return the kind of each obstacle pixel by its number, and 0 where there is no obstacle.

    A pixel with several cues has the kind of the first of `Cue`, and one without that of its
    obstacle.

    Parameters
    ----------
    cues : ndarray of uint8, shape (height, width)
    numbers : ndarray of int32, shape (height, width)
        Number of each pixel's obstacle; 0 where there is none.
    kinds : sequence of str
        Of each obstacle.
    """
    of_cues = np.zeros(256, np.uint8)
    for cue in reversed(Cue):
        of_cues[(np.arange(256) & cue) > 0] = KIND_NUMBERS[KINDS[cue]]
    of_obstacles = np.array([0, *(KIND_NUMBERS[kind] for kind in kinds)], np.uint8)
    found = of_obstacles[numbers]
    own = of_cues[cues]
    return np.where((found > 0) & (own > 0), own, found)


def _measure(
    number: int,
    box: NDArray[np.int32],
    labels: NDArray[np.int32],
    points: NDArray[np.float32],
    height_m: NDArray[np.float32],
    confidence: float,
    kind: Kind,
    tail_share: float,
) -> Obstacle:
    left, top, width, height, pixels = (int(value) for value in box)
    window = np.s_[top : top + height, left : left + width]
    inside = (labels[window] == number) & np.isfinite(height_m[window])
    inside &= np.isfinite(points[window][..., 2])
    if not inside.any():
        nowhere = (np.nan, np.nan, np.nan)
        return Obstacle(
            left, top, width, height, pixels, nowhere, nowhere, np.nan, np.nan, confidence, kind
        )
    own = points[window].reshape(-1, 3).take(np.flatnonzero(inside), axis=0)
    x, y, z = np.ascontiguousarray(own.T)
    low, high = tail_share, 1 - tail_share
    ranges_m = np.sqrt(x * x + y * y + z * z)
    return Obstacle(
        left=left,
        top=top,
        width=width,
        height=height,
        pixels=pixels,
        minimum_m=(quantile(x, low), quantile(y, low), quantile(z, low)),
        maximum_m=(quantile(x, high), quantile(y, high), quantile(z, high)),
        max_height_m=quantile(height_m[window][inside], high),
        range_m=quantile(ranges_m, low),
        confidence=confidence,
        kind=kind,
    )
