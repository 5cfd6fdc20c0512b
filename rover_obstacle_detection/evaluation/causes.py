"""Why an obstacle was missed or invented: the likeliest cause that can be measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.evaluation.disparity_error import seen_by_both, true_disparity
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import ROCK, SLOPE
from rover_obstacle_detection.evaluation.surroundings import (
    Surroundings,
    median,
    quantile,
    slope_deg,
    top,
)
from rover_obstacle_detection.evaluation.vertical import angle_between_deg, angles_deg

MISSED_ROCK, MISSED_AREA, FALSE_ALARM = 'missed rock', 'missed slope or drop', 'false alarm'

MIN_SHARE = 0.5
MIN_DIFFERENCE_M = 0.01
MIN_OFF_PX = 1.0
MIN_TILT_DEG = 2.0
DARK_GREY_LEVEL = 30.0
LITTLE_TEXTURE = 3.0
SMALL_FLAGGED_SHARE = 0.1
BESIDE_PX = 5
TAIL_SHARE = 0.9


@dataclass(frozen=True)
class Cause:
    """A cause: its name, the same for all of its kind, and what was measured."""

    name: str
    detail: str = ''

    def __str__(self) -> str:
        return f'{self.name} ({self.detail})' if self.detail else self.name


class FrameCauses:
    """Finds the causes of what is wrong in one frame.

    Parameters
    ----------
    detection : Detection
    frame : LabelledFrame
        With depth.

    Notes
    -----
    The detector's height H over its local ground G is that of a point over its ground plane less
    that of G. Both can be told apart from the truth: the points by the true depth, the ground by
    the true ground around.
    """

    def __init__(self, detection: Detection, frame: LabelledFrame) -> None:
        if frame.depth_m is None:
            msg = 'causes cannot be told without depth'
            raise ValueError(msg)
        self._depth_m = frame.depth_m
        self._detection = detection
        self._frame = frame
        self._limit_m = detection.config.max_step
        self._truth = true_disparity(frame.depth_m, frame.camera)
        self._seen_by_both = seen_by_both(self._truth, frame.camera)
        self._true_points = reproject(np.nan_to_num(self._truth), frame.camera)
        plane = detection.ground
        self._seen_m = _over(plane, detection.points)
        self._true_m = _over(plane, self._true_points)
        self._around = Surroundings(
            self._true_points, self._true_m, frame.instances == 0, plane, frame.camera
        )

    def vertical(self) -> str | None:
        """Say how far off the estimated vertical is, where it is known and far off."""
        gravity = self._frame.gravity
        if gravity is None:
            return None
        tilt_deg = angle_between_deg(gravity, self._detection.ground.up)
        if tilt_deg < MIN_TILT_DEG:
            return None
        true_deg, seen_deg = angles_deg(gravity.up), angles_deg(self._detection.ground.up)
        pitch_deg, roll_deg = (seen - true for seen, true in zip(seen_deg, true_deg, strict=True))
        return f'pitch off by {pitch_deg:+.1f} degrees, roll by {roll_deg:+.1f}'

    def of(self, kind: str, inside: NDArray[np.bool_]) -> Cause:
        """Find the likeliest cause of one fault.

        Parameters
        ----------
        kind : str
            As in `Fault`.
        inside : ndarray of bool, shape (height, width)
            Pixels of the obstacle missed, or of the false alarm.
        """
        finders: dict[str, Callable[[NDArray[np.bool_]], Cause]] = {
            MISSED_ROCK: self._of_missed_rock,
            MISSED_AREA: self._of_missed_area,
            FALSE_ALARM: self._of_false_alarm,
        }
        return finders[kind](inside)

    def _of_missed_rock(self, inside: NDArray[np.bool_]) -> Cause:
        if (cause := self._unseen(inside)) is not None:
            return cause
        judged = inside & self._judged
        measured_m = top(self._detection.height[judged])
        ground_m = self._around.ground(inside)
        if ground_m is None:
            said = f'{self._measured(measured_m)}, hardly any ground is seen around it'
            return Cause('measured too low', said)
        true_m = top((self._true_m - ground_m)[inside])
        said = self._measured(measured_m, true_m)
        share = self._flagged_share(inside)
        if share >= SMALL_FLAGGED_SHARE:
            return Cause('found in part', f'{_percent(share)} of it flagged, {said}')
        if true_m < self._limit_m:
            return Cause('low above the ground around it', said)
        lacking_m = true_m - measured_m
        ground_error_m = median((self._seen_m - self._detection.height - ground_m)[judged])
        matched_error_m = top(self._seen_m[judged]) - top(self._true_m[judged])
        for name, error_m, words in (
            ('ground too high', ground_error_m, 'estimated {} too high under it'),
            ('flattened by matching', -matched_error_m, 'its top matched {} too low'),
        ):
            if error_m > max(MIN_DIFFERENCE_M, lacking_m / 2):
                return Cause(name, f'{words.format(_centimetres(error_m))}, {said}')
        name = 'hardly over the limit' if measured_m > self._limit_m else 'measured too low'
        return Cause(name, said)

    def _of_missed_area(self, inside: NDArray[np.bool_]) -> Cause:
        if (cause := self._unseen(inside)) is not None:
            return cause
        flagged = f'{_percent(self._flagged_share(inside))} of it flagged'
        is_slope = np.mean(self._frame.labels[inside] == SLOPE) >= MIN_SHARE
        if is_slope and (tilt := self.vertical()) is not None:
            return Cause('vertical off', f'{tilt}, {flagged}')
        if is_slope:
            up = self._detection.ground.up
            measured_deg = slope_deg(self._detection.points[inside & self._judged], up)
            true_up = up if self._frame.gravity is None else self._frame.gravity.up
            true_deg = slope_deg(self._true_points[inside], true_up)
            limit_deg = self._detection.config.max_slope
            said = f'{true_deg:.0f} degrees, measured {measured_deg:.0f}, limit {limit_deg:g}'
            name = 'measured too flat' if measured_deg < limit_deg else 'found in part'
            return Cause(name, f'{said}, {flagged}')
        ground_m = self._around.ground(inside)
        if ground_m is None:
            return Cause('drop not recognised', flagged)
        true_m = -median((self._true_m - ground_m)[inside])
        measured_m = -median((self._seen_m - ground_m)[inside & self._judged])
        said = f'{_centimetres(true_m)} below what is around it'
        said = f'{said}, measured {_centimetres(measured_m)}, limit {_centimetres(self._limit_m)}'
        return Cause('drop not recognised', f'{said}, {flagged}')

    def _of_false_alarm(self, inside: NDArray[np.bool_]) -> Cause:
        detection = self._detection
        judged = inside & self._judged
        ground_m = self._around.ground(inside)
        measured_m = top(detection.height[judged])
        rock = inside & (self._frame.instances > 0)
        if rock.sum() >= MIN_SHARE * inside.sum() and ground_m is not None:
            true_m = top((self._true_m - ground_m)[rock])
            return Cause('rock under the limit', self._measured(measured_m, true_m))
        matched = inside & (detection.disparity > 0)
        cue = self._cue(inside)
        if matched.sum() < MIN_SHARE * inside.sum():
            return Cause('no match', f'{cue}, {self._looks(inside)}')
        if ('slope' in cue or 'drop' in cue) and (tilt := self.vertical()) is not None:
            return Cause('vertical off', f'{cue}, {tilt}')
        off_px = median((detection.disparity - self._truth)[matched])
        raised_m = median((self._seen_m - self._true_m)[matched])
        said = f'{cue}, measured {_centimetres(measured_m)} high'
        if abs(off_px) >= MIN_OFF_PX or raised_m > max(MIN_DIFFERENCE_M, measured_m / 2):
            wrong = f'disparity off by {off_px:+.1f} px, {_centimetres(raised_m)} in height'
            return Cause('false match', f'{wrong}, {said}, {self._looks(inside)}')
        if ground_m is not None:
            error_m = median((self._seen_m - detection.height - ground_m)[judged])
            if -error_m > max(MIN_DIFFERENCE_M, measured_m / 3):
                low = f'estimated {_centimetres(-error_m)} too low'
                return Cause('ground too low', f'{low}, {said}')
        if self._touches_rock(inside):
            return Cause('beside a rock', said)
        tail_px = quantile(np.abs((detection.disparity - self._truth)[matched]), TAIL_SHARE)
        off = f'disparity off by {off_px:+.1f} px, in a tenth of it by over {tail_px:.1f} px'
        return Cause('noise', f'{off}, {said}, {self._looks(inside)}')

    @cached_property
    def _judged(self) -> NDArray[np.bool_]:
        return self._detection.known & np.isfinite(self._detection.height)

    def _unseen(self, inside: NDArray[np.bool_]) -> Cause | None:
        """Tell what was not matched or not judged from what was."""
        pixels = inside.sum()
        if (inside & self._judged).sum() >= MIN_SHARE * pixels:
            return None
        matched = float((inside & (self._detection.disparity > 0)).sum() / pixels)
        if matched < MIN_SHARE:
            said = f'{_percent(matched)} of its pixels have a disparity'
            hidden = (inside & ~self._seen_by_both).sum() >= MIN_SHARE * pixels
            name = 'not seen by the right eye' if hidden else 'not matched'
            return Cause(name, said if hidden else f'{said}, {self._looks(inside)}')
        farthest_m = self._detection.config.max_range
        if median(self._depth_m[inside]) > farthest_m:
            return Cause('outside the judged range', f'max_range is {farthest_m:g} m')
        noise_m = median(self._detection.height_noise[inside])
        return Cause('outside the judged range', f'noise of a height {_centimetres(noise_m)}')

    def _measured(self, measured_m: float, true_m: float | None = None) -> str:
        said = f'measured {_centimetres(measured_m)}, limit {_centimetres(self._limit_m)}'
        return said if true_m is None else f'{_centimetres(true_m)} high, {said}'

    def _flagged_share(self, inside: NDArray[np.bool_]) -> float:
        return float(np.mean(self._detection.mask[inside] != 0))

    def _looks(self, inside: NDArray[np.bool_]) -> str:
        grey = self._detection.grey[inside]
        level = f'grey level {np.mean(grey):.0f}'
        if np.mean(grey) < DARK_GREY_LEVEL:
            return f'in shadow: {level}'
        spread = float(quantile(grey, 0.9) - quantile(grey, 0.1))
        return f'no texture: {level}' if spread < LITTLE_TEXTURE else level

    def _cue(self, inside: NDArray[np.bool_]) -> str:
        """Name the cue that made most of its pixels obstacles."""
        cues = self._detection.cues[inside]
        counts = {cue: int(np.count_nonzero(cues & cue)) for cue in Cue}
        best = max(counts, key=lambda cue: counts[cue])
        if not counts[best]:
            return 'flagged by its outline alone'
        return f'flagged by its {str(best.name).lower().replace("_", " ")}'

    def _touches_rock(self, inside: NDArray[np.bool_]) -> bool:
        rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
        near = np.s_[
            max(0, rows[0] - BESIDE_PX) : rows[-1] + BESIDE_PX + 1,
            max(0, columns[0] - BESIDE_PX) : columns[-1] + BESIDE_PX + 1,
        ]
        kernel = np.ones((2 * BESIDE_PX + 1, 2 * BESIDE_PX + 1), np.uint8)
        grown = cv2.dilate(inside[near].astype(np.uint8), kernel) != 0
        return bool(np.any(self._frame.labels[near][grown] == ROCK))


def _over(plane: GroundPlane, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Height of points over a plane, metres; NaN where there is none."""
    normal = np.asarray(plane.normal, np.float32)
    return np.asarray(points @ normal + np.float32(plane.height_m), np.float32)


def _centimetres(value_m: float) -> str:
    return f'{100 * value_m:.0f} cm'


def _percent(value: float) -> str:
    return f'{100 * value:.0f} %'
