"""Choose the frames that a report shows, and keep their pictures as JPEG files in memory."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.offline.picture_files import encode_jpeg
from rover_obstacle_detection.offline.summary import ReplayFrame
from rover_obstacle_detection.pictures import (
    Picture,
    disparity_picture,
    height_limit_m,
    height_picture,
)
from rover_obstacle_detection.report.page import PictureBlock

EVENLY_CHOSEN = 160
WORST = 10
JPEG = 'image/jpeg'
_OVERLAY_WIDTH, _DETAIL_WIDTH = 640, 320
_QUALITY = 75
_OVERLAY_CAPTION = (
    'overlay: rock red, slope yellow, drop magenta, rough green, unmeasured blue; hatched: '
    'unknown; no colour: free'
)

Badness = Callable[[ReplayFrame], float]
"""How bad a frame is; not finite if there is nothing bad about it."""

RANKINGS: Mapping[str, Badness] = {
    'most unknown': lambda frame: frame.summary.unknown_share,
    'nearest obstacle': lambda frame: -frame.summary.nearest_obstacle_m,
    'most warnings': lambda frame: len(frame.warnings) or math.nan,
}


@dataclass(frozen=True)
class _Ranked:
    badness: float
    number: int

    def __lt__(self, other: _Ranked) -> bool:
        # Of equals, the first frame is the worse one.
        return (self.badness, -self.number) < (other.badness, -other.number)


class Gallery:
    """The pictures of at most ``EVENLY_CHOSEN + WORST * len(RANKINGS)`` frames.

    Those are frames at even distances, however many there are, and the worst of each ranking.
    """

    def __init__(self, evenly: int = EVENLY_CHOSEN, worst: int = WORST) -> None:
        self._evenly = evenly
        self._worst = worst
        self._stride = 1
        self._even: list[int] = []
        self._ranked: dict[str, list[_Ranked]] = {name: [] for name in RANKINGS}
        self.pictures: dict[int, tuple[PictureBlock, ...]] = {}

    def offer(self, frame: ReplayFrame, draw: Callable[[], tuple[PictureBlock, ...]]) -> None:
        """Keep a frame if it is among those to show; only then draw it."""
        ranked = {
            name: self._with(self._ranked[name], badness(frame), frame.number)
            for name, badness in RANKINGS.items()
        }
        even, stride = self._even, self._stride
        if (frame.number - 1) % stride == 0:
            even = [*even, frame.number]
        if len(even) > self._evenly:
            stride *= 2
            even = [number for number in even if (number - 1) % stride == 0]
        shown = {*even, *(each.number for ranking in ranked.values() for each in ranking)}
        if frame.number in shown:
            self.pictures[frame.number] = draw()
        # After drawing: a frame that cannot be drawn is as if it had not been.
        self._even, self._stride, self._ranked = even, stride, ranked
        for number in self.pictures.keys() - shown:
            del self.pictures[number]

    def discard(self, number: int) -> None:
        """Forget a frame that could not be written."""
        self.pictures.pop(number, None)
        self._even = [each for each in self._even if each != number]
        self._ranked = {
            name: [each for each in ranking if each.number != number]
            for name, ranking in self._ranked.items()
        }

    def worst(self, name: str) -> list[int]:
        """Return the numbers of the worst frames of a ranking, worst first."""
        return [each.number for each in sorted(self._ranked[name], reverse=True)]

    def _with(self, ranking: list[_Ranked], badness: float, number: int) -> list[_Ranked]:
        if not math.isfinite(badness):
            return ranking
        return heapq.nlargest(self._worst, [*ranking, _Ranked(badness, number)])


def report_pictures(detection: Detection, overlay: Picture) -> tuple[PictureBlock, ...]:
    """Return overlay, disparity and height of a frame as JPEG files."""
    limit_m = height_limit_m(detection)
    return (
        _jpeg(_OVERLAY_CAPTION, overlay, _OVERLAY_WIDTH),
        _jpeg(
            'disparity: far blue to near red; black: no match',
            disparity_picture(detection),
            _DETAIL_WIDTH,
        ),
        _jpeg(
            f'height above the ground: -{limit_m:g} m blue, level green, {limit_m:g} m red; '
            'black: none',
            height_picture(detection),
            _DETAIL_WIDTH,
        ),
    )


def _jpeg(caption: str, picture: Picture, width: int) -> PictureBlock:
    if picture.shape[1] > width:
        height = max(1, round(picture.shape[0] * width / picture.shape[1]))
        size = (width, height)
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    return PictureBlock(caption, encode_jpeg(picture, _QUALITY), JPEG)
