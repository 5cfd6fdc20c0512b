"""2D only: a cascade of boosted features (reference 5 of the study; Viola and Jones 2001).

OpenCV's own `CascadeClassifier` does not serve: OpenCV 5 no longer has it, and the program that
trains its models is in no wheel. The model beside this file is from ``scripts/train_cascade.py``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.evaluation.methods.method import Mask, as_mask

MODEL_FILE = 'cascade.json'
# A window is a box around a rock (rows, columns) and its surroundings on each side, pixels.
BOX = (12, 16)
MARGIN = 4
WINDOW = (BOX[0] + 2 * MARGIN, BOX[1] + 2 * MARGIN)
# Distance of windows, pixels, and the ratio of a level's scale to that of the one before.
STRIDE = 2
SCALE_STEP = 1.2
# Of two boxes that overlap more than this (IoU), the one with the lower score is dropped.
MAX_OVERLAP = 0.3
# Least standard deviation by which grey levels are divided: flat windows show quantisation only.
MIN_DEVIATION = 1.0
# Likewise for the mean gradient (Sobel), grey levels.
MIN_GRADIENT = 1.0
GREY, GRADIENT = range(2)
# Weights of the cells of a feature. Those of the grey level sum to 0, so brightness cancels out.
PATTERNS = tuple(
    np.array(cells, np.float64)
    for cells in (
        [[-1, 1]],
        [[-1], [1]],
        [[-1, 2, -1]],
        [[-1], [2], [-1]],
        [[-1, 1], [1, -1]],
        [[-1, -1, -1], [-1, 8, -1], [-1, -1, -1]],
        [[1]],
    )
)
WHOLE = len(PATTERNS) - 1
# Row, column and weight of the corners of a pattern's cells in the integral image. Cells that
# touch share corners.
CORNERS = tuple(
    [(row, column, corners[row, column]) for row, column in np.argwhere(corners)]
    for corners in (np.diff(np.diff(np.pad(cells, 1), axis=0), axis=1) for cells in PATTERNS)
)

Numbers = NDArray[np.intp]
Values = NDArray[np.float64]
Boxes = NDArray[np.float64]


class Feature(NamedTuple):
    """A pattern of equal cells in a window.

    Parameters
    ----------
    channel : int
        `GREY` or `GRADIENT`.
    pattern : int
        Index into `PATTERNS`.
    row, column : int
        Of the pattern's upper left corner in the window.
    height, width : int
        Of one cell, pixels.
    """

    channel: int
    pattern: int
    row: int
    column: int
    height: int
    width: int


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of an image at one scale, and the integral images that they lie in.

    Parameters
    ----------
    channels : sequence of ndarray of float64, shape (rows * row_length,)
        Integral images of grey level and gradient, row by row.
    row_length : int
    starts : ndarray of int, shape (windows,)
        Where in the integral images the upper left corner of each window is.
    deviation : ndarray of float64, shape (windows,)
        Standard deviation of the grey level in each window.
    boxes : ndarray of float64, shape (windows, 4)
        Column, row, width and height of each window's box in the original image, pixels.
    """

    channels: Sequence[Values]
    row_length: int
    starts: Numbers
    deviation: Values
    boxes: Boxes

    def values(self, feature: Feature, numbers: Numbers) -> Values:
        """Compute a feature in the windows of these numbers.

        Returns
        -------
        ndarray of float64, shape (numbers,)
            Sum of the weighted means of the cells. Grey levels are divided by the window's
            standard deviation.
        """
        starts = self.starts[numbers] + feature.row * self.row_length + feature.column
        values = np.zeros(len(numbers))
        for row, column, weight in CORNERS[feature.pattern]:
            offset = row * feature.height * self.row_length + column * feature.width
            values += weight * self.channels[feature.channel][starts + offset]
        values /= feature.height * feature.width
        return values / self.deviation[numbers] if feature.channel == GREY else values


def all_windows(grey: NDArray[np.uint8]) -> Iterator[Windows]:
    """Windows of an image at one scale after the other, as long as a box fits into the image."""
    scale = 1.0
    while True:
        size = tuple(round(length / scale) for length in grey.shape)
        if size[0] < BOX[0] or size[1] < BOX[1]:
            return
        small = cv2.resize(grey, size[::-1], interpolation=cv2.INTER_AREA)
        yield windows_of(np.asarray(small, np.uint8), scale)
        scale *= SCALE_STEP


def windows_of(grey: NDArray[np.uint8], scale: float = 1.0) -> Windows:
    """Windows of an image, row by row; its edge is repeated so that boxes reach it.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    scale : float
        Pixels of the original image per pixel of this one.
    """
    grey = np.asarray(cv2.copyMakeBorder(grey, *(MARGIN,) * 4, cv2.BORDER_REPLICATE), np.uint8)
    slopes = (cv2.Sobel(grey, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    slope = np.asarray(cv2.magnitude(*slopes))
    gradient = slope / np.float32(max(float(slope.mean()), MIN_GRADIENT))
    sums, squares, gradients = (
        np.asarray(integral, np.float64)
        for integral in (
            *cv2.integral2(grey, sdepth=cv2.CV_64F, sqdepth=cv2.CV_64F),
            cv2.integral(gradient, sdepth=cv2.CV_64F),
        )
    )
    rows, columns = (
        np.arange(0, size - window + 1, STRIDE)
        for size, window in zip(grey.shape, WINDOW, strict=True)
    )
    corners = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    return Windows(
        (sums.ravel(), gradients.ravel()),
        sums.shape[1],
        corners[:, 1] * sums.shape[1] + corners[:, 0],
        np.sqrt(np.maximum(_means(squares) - _means(sums) ** 2, MIN_DEVIATION**2)),
        np.hstack((corners, np.broadcast_to(BOX[::-1], corners.shape))) * scale,
    )


def _means(integral: Values) -> Values:
    """Mean in each window, from an integral image."""
    height, width = WINDOW
    total = integral[height:] - integral[:-height]
    total = total[:, width:] - total[:, :-width]
    return total[::STRIDE, ::STRIDE].ravel() / (height * width)


@dataclass(frozen=True)
class Stage:
    """Boosted stumps, and the score that a window needs to get past them.

    Parameters
    ----------
    features : sequence of Feature
    thresholds : sequence of float
        Of each feature's value.
    weights : sequence of float
        Added to the score above the threshold, and subtracted at it and below.
    min_score : float
    """

    features: Sequence[Feature]
    thresholds: Sequence[float]
    weights: Sequence[float]
    min_score: float

    def scores(self, windows: Windows, numbers: Numbers) -> Values:
        """Score the windows of these numbers."""
        scores = np.zeros(len(numbers))
        stumps = zip(self.features, self.thresholds, self.weights, strict=True)
        for feature, threshold, weight in stumps:
            scores += np.where(windows.values(feature, numbers) > threshold, weight, -weight)
        return scores


@dataclass(frozen=True)
class Cascade:
    """Stages that a window must get past, the cheapest first.

    Parameters
    ----------
    stages : sequence of Stage
    """

    stages: Sequence[Stage]

    @classmethod
    def from_json(cls, text: str) -> Cascade:
        """Read what `to_json` wrote."""
        return cls(
            [
                Stage(**{**stage, 'features': [Feature(*each) for each in stage['features']]})
                for stage in json.loads(text)
            ]
        )

    def to_json(self) -> str:
        """Write the stages as a list, with a line for each."""
        return '[\n' + ',\n'.join(json.dumps(asdict(stage)) for stage in self.stages) + '\n]\n'

    def survivors(self, windows: Windows) -> tuple[Numbers, Values]:
        """Numbers of the windows that get past all stages, and their scores in the last one."""
        numbers: Numbers = np.arange(len(windows.starts))
        scores: Values = np.zeros(len(numbers))
        for stage in self.stages:
            scores = stage.scores(windows, numbers)
            passes = scores >= stage.min_score
            numbers, scores = numbers[passes], scores[passes]
        return numbers, scores

    def detect(self, grey: NDArray[np.uint8]) -> tuple[Boxes, Values]:
        """Find rocks in an image.

        Returns
        -------
        boxes : ndarray of float64, shape (n, 4)
            Column, row, width, height; the best score first.
        scores : ndarray of float64, shape (n,)
        """
        boxes, scores = [np.empty((0, 4))], [np.empty(0)]
        for windows in all_windows(grey):
            numbers, found = self.survivors(windows)
            boxes.append(windows.boxes[numbers])
            scores.append(found)
        return without_overlap(np.concatenate(boxes), np.concatenate(scores))


def without_overlap(boxes: Boxes, scores: Values) -> tuple[Boxes, Values]:
    """Drop boxes that overlap a kept box of a better score by more than `MAX_OVERLAP`."""
    left = np.argsort(-scores, kind='stable')
    kept = []
    while len(left):
        kept.append(left[0])
        left = left[overlaps(boxes[left[:1]], boxes[left])[0] <= MAX_OVERLAP]
    return boxes[kept], scores[kept]


def overlaps(boxes: Boxes, others: Boxes) -> Values:
    """Intersection over union of each of n boxes with each of m others, shape (n, m)."""
    first, second = boxes[:, np.newaxis], others[np.newaxis]
    low = np.maximum(first[..., :2], second[..., :2])
    high = np.minimum(first[..., :2] + first[..., 2:], second[..., :2] + second[..., 2:])
    shared = np.prod(np.maximum(high - low, 0), axis=-1)
    both = np.prod(first[..., 2:], axis=-1) + np.prod(second[..., 2:], axis=-1)
    return np.asarray(shared / (both - shared))


def covered(boxes: Boxes, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Mark the pixels of an image of this shape that are in any of the boxes."""
    area = np.zeros(shape, bool)
    for column, row, width, height in boxes:
        area[round(row) : round(row + height), round(column) : round(column + width)] = True
    return area


class BoostedCascade:
    """Flags the boxes of what a trained cascade takes for a rock in the left image.

    Parameters
    ----------
    cascade : Cascade, optional
        The one that comes with the package by default.
    """

    def __init__(self, cascade: Cascade | None = None) -> None:
        if cascade is None:
            model = resources.files(__package__) / MODEL_FILE
            cascade = Cascade.from_json(model.read_text(encoding='utf-8'))
        self.cascade = cascade

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Find obstacles; see `Method`."""
        grey, _ = grey_pair(left, right, camera)
        boxes, _ = self.cascade.detect(grey)
        return as_mask(covered(boxes, grey.shape))
