"""The most likely measurable cause of a missed obstacle or a false alarm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import ROCK, SLOPE
from rover_obstacle_detection.evaluation.methods.dense_stereo import height_above
from rover_obstacle_detection.evaluation.surroundings import (
    Surroundings,
    median,
    quantile,
    slope_deg,
    top,
)
from rover_obstacle_detection.evaluation.true_disparity import true_disparity, visible_in_both
from rover_obstacle_detection.evaluation.vertical import angle_between_deg, angles_deg

MISSED_ROCK, MISSED_AREA, FALSE_ALARM = 'missed rock', 'missed slope or drop', 'false alarm'

# A property applies to a part if at least this share of its pixels has it.
MIN_SHARE = 0.5
# Smaller height and disparity errors are measurement noise.
MIN_DIFFERENCE_M = 0.01
MIN_OFF_PX = 1.0
# Smaller errors of the vertical do not change what counts as a slope or a drop.
MIN_TILT_DEG = 2.0
# Grey levels of 255: the mean of a shadow, and the 10-90 % spread of a textureless surface.
DARK_GREY_LEVEL = 30.0
LITTLE_TEXTURE = 3.0
# An obstacle with less than this flagged counts as missed entirely.
SMALL_FLAGGED_SHARE = 0.1
# A false alarm this close to a rock is attributed to it.
BESIDE_PX = 5
# Quantile of the disparity errors that shows the tail of the noise.
TAIL_SHARE = 0.9


@dataclass(frozen=True)
class Cause:
    """A cause: a name to count by, and the measurements behind it."""

    name: str
    detail: str = ''

    def __str__(self) -> str:
        return f'{self.name} ({self.detail})' if self.detail else self.name


class FrameCauses:
    """Finds the causes of the faults in one frame.

    Parameters
    ----------
    detection : Detection
    frame : LabelledFrame
        With depth.

    Raises
    ------
    ValueError
        If the frame has no depth.

    Notes
    -----
    A detected height is the height of a point minus that of its local ground. Ground truth shows
    which of the two is wrong: the true depth checks the point, the true ground around the
    obstacle checks the local ground.
    """

    def __init__(self, detection: Detection, frame: LabelledFrame) -> None:
        if frame.depth_m is None:
            msg = 'finding causes needs true depth'
            raise ValueError(msg)
        self._depth_m = frame.depth_m
        self._detection = detection
        self._frame = frame
        self._limit_m = detection.config.max_step
        self._truth = true_disparity(frame.depth_m, frame.camera)
        self._visible_in_both = visible_in_both(self._truth, frame.camera)
        self._true_points = reproject(np.nan_to_num(self._truth), frame.camera)
        plane = detection.ground
        self._measured_m = height_above(plane, detection.points)
        self._true_m = height_above(plane, self._true_points)
        self._around = Surroundings(
            self._true_points, self._true_m, frame.instances == 0, plane, frame.camera
        )

    def vertical(self) -> str | None:
        """Describe the error of the estimated vertical; None if small or unknown."""
        gravity = self._frame.gravity
        if gravity is None:
            return None
        tilt_deg = angle_between_deg(gravity, self._detection.ground.up)
        if tilt_deg < MIN_TILT_DEG:
            return None
        true_pitch_deg, true_roll_deg = angles_deg(gravity.up)
        pitch_deg, roll_deg = angles_deg(self._detection.ground.up)
        pitch = f'pitch off by {pitch_deg - true_pitch_deg:+.1f} degrees'
        return f'{pitch}, roll by {roll_deg - true_roll_deg:+.1f}'

    def of(self, kind: str, inside: NDArray[np.bool_]) -> Cause:
        """Find the most likely cause of one fault.

        Parameters
        ----------
        kind : str
            As in `Fault`.
        inside : ndarray of bool, shape (height, width)
            Pixels of the missed obstacle or of the false alarm.
        """
        finders: dict[str, Callable[[NDArray[np.bool_]], Cause]] = {
            MISSED_ROCK: self._of_missed_rock,
            MISSED_AREA: self._of_missed_area,
            FALSE_ALARM: self._of_false_alarm,
        }
        return finders[kind](inside)

    def _of_missed_rock(self, inside: NDArray[np.bool_]) -> Cause:
        if (cause := self._not_judged(inside)) is not None:
            return cause
        judged = inside & self._judged
        measured_m = top(self._detection.height[judged])
        ground_m = self._around.ground(inside)
        if ground_m is None:
            detail = f'{self._measured(measured_m)}, too little visible ground around it'
            return Cause('measured too low', detail)
        true_m = top((self._true_m - ground_m)[inside])
        detail = self._measured(measured_m, true_m)
        share = self._flagged_share(inside)
        if share >= SMALL_FLAGGED_SHARE:
            return Cause('partly found', f'{_percent(share)} flagged, {detail}')
        if true_m < self._limit_m:
            return Cause('low above the surrounding ground', detail)
        missing_m = true_m - measured_m
        ground_error_m = median((self._measured_m - self._detection.height - ground_m)[judged])
        matched_error_m = top(self._measured_m[judged]) - top(self._true_m[judged])
        for name, error_m, words in (
            ('ground estimated too high', ground_error_m, 'by {}'),
            ('flattened by matching', -matched_error_m, 'top {} too low'),
        ):
            if error_m > max(MIN_DIFFERENCE_M, missing_m / 2):
                return Cause(name, f'{words.format(_centimetres(error_m))}, {detail}')
        name = 'just above the limit' if measured_m > self._limit_m else 'measured too low'
        return Cause(name, detail)

    def _of_missed_area(self, inside: NDArray[np.bool_]) -> Cause:
        if (cause := self._not_judged(inside)) is not None:
            return cause
        flagged = f'{_percent(self._flagged_share(inside))} flagged'
        is_slope = np.mean(self._frame.labels[inside] == SLOPE) >= MIN_SHARE
        if is_slope and (tilt := self.vertical()) is not None:
            return Cause('vertical estimate off', f'{tilt}, {flagged}')
        if is_slope:
            up = self._detection.ground.up
            measured_deg = slope_deg(self._detection.points[inside & self._judged], up)
            true_up = up if self._frame.gravity is None else self._frame.gravity.up
            true_deg = slope_deg(self._true_points[inside], true_up)
            limit_deg = self._detection.config.max_slope
            detail = (
                f'true {true_deg:.0f} degrees, measured {measured_deg:.0f}, limit {limit_deg:g}'
            )
            name = 'measured too flat' if measured_deg < limit_deg else 'partly found'
            return Cause(name, f'{detail}, {flagged}')
        ground_m = self._around.ground(inside)
        if ground_m is None:
            return Cause('drop not recognised', flagged)
        true_m = -median((self._true_m - ground_m)[inside])
        measured_m = -median((self._measured_m - ground_m)[inside & self._judged])
        depths = f'true depth {_centimetres(true_m)}, {self._measured(measured_m)}'
        return Cause('drop not recognised', f'{depths}, {flagged}')

    def _of_false_alarm(self, inside: NDArray[np.bool_]) -> Cause:
        detection = self._detection
        judged = inside & self._judged
        ground_m = self._around.ground(inside)
        measured_m = top(detection.height[judged])
        rock = inside & (self._frame.instances > 0)
        if rock.sum() >= MIN_SHARE * inside.sum() and ground_m is not None:
            true_m = top((self._true_m - ground_m)[rock])
            return Cause('rock below the limit', self._measured(measured_m, true_m))
        matched = inside & (detection.disparity > 0)
        cue = self._cue(inside)
        if matched.sum() < MIN_SHARE * inside.sum():
            return Cause('no match', f'{cue}, {self._looks(inside)}')
        if ('slope' in cue or 'drop' in cue) and (tilt := self.vertical()) is not None:
            return Cause('vertical estimate off', f'{cue}, {tilt}')
        off_px = median((detection.disparity - self._truth)[matched])
        raised_m = median((self._measured_m - self._true_m)[matched])
        detail = f'{cue}, measured height {_centimetres(measured_m)}'
        if abs(off_px) >= MIN_OFF_PX or raised_m > max(MIN_DIFFERENCE_M, measured_m / 2):
            error = f'disparity off by {off_px:+.1f} px, height by {_centimetres(raised_m)}'
            return Cause('false match', f'{error}, {detail}, {self._looks(inside)}')
        if ground_m is not None:
            error_m = median((self._measured_m - detection.height - ground_m)[judged])
            if -error_m > max(MIN_DIFFERENCE_M, measured_m / 3):
                return Cause('ground estimated too low', f'by {_centimetres(-error_m)}, {detail}')
        if self._touches_rock(inside):
            return Cause('next to a rock', detail)
        tail_px = quantile(np.abs((detection.disparity - self._truth)[matched]), TAIL_SHARE)
        error = f'disparity off by {off_px:+.1f} px, 10 % of it by over {tail_px:.1f} px'
        return Cause('noise', f'{error}, {detail}, {self._looks(inside)}')

    @cached_property
    def _judged(self) -> NDArray[np.bool_]:
        return self._detection.known & np.isfinite(self._detection.height)

    def _not_judged(self, inside: NDArray[np.bool_]) -> Cause | None:
        """Return why most of a part was not judged; None if it was."""
        pixels = inside.sum()
        if (inside & self._judged).sum() >= MIN_SHARE * pixels:
            return None
        matched = float((inside & (self._detection.disparity > 0)).sum() / pixels)
        if matched < MIN_SHARE:
            detail = f'{_percent(matched)} of its pixels have a disparity'
            if (inside & ~self._visible_in_both).sum() >= MIN_SHARE * pixels:
                return Cause('not visible in the right image', detail)
            return Cause('not matched', f'{detail}, {self._looks(inside)}')
        max_range_m = self._detection.config.max_range
        if median(self._depth_m[inside]) > max_range_m:
            return Cause('beyond the detection range', f'max_range {max_range_m:g} m')
        noise_m = median(self._detection.height_noise[inside])
        if noise_m > self._detection.parameters.terrain.max_noise_share * self._limit_m:
            return Cause('beyond the detection range', f'height noise {_centimetres(noise_m)}')
        return Cause('in doubt')

    def _measured(self, measured_m: float, true_m: float | None = None) -> str:
        detail = f'measured {_centimetres(measured_m)}, limit {_centimetres(self._limit_m)}'
        return detail if true_m is None else f'true height {_centimetres(true_m)}, {detail}'

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
        """Name the cue that flagged most of a part."""
        cues = self._detection.cues[inside]
        counts = {cue: int(np.count_nonzero(cues & cue)) for cue in Cue}
        best = max(counts, key=lambda cue: counts[cue])
        if not counts[best]:
            return 'flagged by the morphology alone'
        return f'flagged by {str(best.name).lower().replace("_", " ")}'

    def _touches_rock(self, inside: NDArray[np.bool_]) -> bool:
        rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
        near = np.s_[
            max(0, rows[0] - BESIDE_PX) : rows[-1] + BESIDE_PX + 1,
            max(0, columns[0] - BESIDE_PX) : columns[-1] + BESIDE_PX + 1,
        ]
        kernel = np.ones((2 * BESIDE_PX + 1, 2 * BESIDE_PX + 1), np.uint8)
        grown = cv2.dilate(inside[near].astype(np.uint8), kernel) != 0
        return bool(np.any(self._frame.labels[near][grown] == ROCK))


def _centimetres(value_m: float) -> str:
    return f'{100 * value_m:.0f} cm'


def _percent(value: float) -> str:
    return f'{100 * value:.0f} %'
