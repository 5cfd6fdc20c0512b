"""The content of ``summary.json``: inputs, results and times.

``docs/replay.md`` documents every key. Missing numbers, such as the distance of an obstacle
without 3D points, are null, because JSON has no NaN.
"""

from __future__ import annotations

import dataclasses
import math
import platform
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import cv2
import numpy as np

from rover_obstacle_detection import __version__
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.result.detection import OBSTACLE, Detection
from rover_obstacle_detection.detection.result.obstacles import Obstacle
from rover_obstacle_detection.offline.stopwatch import StageTime, stage_times
from rover_obstacle_detection.pairing import PairingStatistics
from rover_obstacle_detection.pictures import shown_obstacles
from rover_obstacle_detection.warning_kinds import WarningCount, count_warnings

FORMAT_VERSION = 1

READ = 'read'
CLOUDS = 'clouds and obstacles'
WRITE_BAG = 'write bag'
WRITE_IMAGES = 'write images'
FILE_STAGES = (READ, WRITE_BAG, WRITE_IMAGES)


@dataclass(frozen=True)
class FrameSummary:
    """The result of one pair in numbers.

    Parameters
    ----------
    obstacles : int
        Number of obstacles.
    obstacle_kinds : mapping of str to int
        Number of obstacles of each kind that there is.
    obstacle_share, matched_share, unknown_share : float
        Share of the image's pixels that are obstacle, have a disparity, are unknown.
    nearest_obstacle_m : float
        Distance from the left camera to the nearest obstacle point; NaN if there is none.
    tallest_obstacle_m : float
        Height of the tallest obstacle above the local ground; NaN if there is none, or no ground
        was found.
    camera_pitch_deg : float
        Angle of the optical axis below the horizon; NaN if no ground was found and gravity is not
        configured.
    camera_height_m : float
        Height of the left camera above the visible ground; NaN if no ground was found.
    rows_off_px : float
        Estimated and corrected row misalignment of the right image, at its worst border.
    lens_bend_px : float
        Estimated and corrected residual lens distortion, mean over the image.
    """

    obstacles: int
    obstacle_kinds: Mapping[str, int]
    obstacle_share: float
    matched_share: float
    unknown_share: float
    nearest_obstacle_m: float
    tallest_obstacle_m: float
    camera_pitch_deg: float
    camera_height_m: float
    rows_off_px: float
    lens_bend_px: float

    @classmethod
    def of(cls, detection: Detection) -> FrameSummary:
        """Summarise a detection."""
        obstacles, ground = shown_obstacles(detection), detection.ground
        upright = ground.measured or detection.config.gravity_source == 'parameters'
        return cls(
            obstacles=len(obstacles),
            obstacle_kinds=dict(Counter(each.kind for each in obstacles).most_common()),
            obstacle_share=float(np.mean(detection.mask == OBSTACLE)),
            matched_share=float(np.mean(detection.disparity > 0)),
            unknown_share=float(np.mean(~detection.known)),
            nearest_obstacle_m=_extreme(min, (each.range_m for each in obstacles)),
            tallest_obstacle_m=_extreme(max, (each.max_height_m for each in obstacles)),
            camera_pitch_deg=ground.pitch_deg if upright else math.nan,
            camera_height_m=ground.height_m if ground.measured else math.nan,
            rows_off_px=detection.alignment.most_px(detection.camera),
            lens_bend_px=detection.lenses.mean_bend_px(detection.camera),
        )

    def as_json(self) -> dict[str, Any]:
        """Return the numbers, with None instead of NaN."""
        return _finite(dataclasses.asdict(self))


@dataclass(frozen=True)
class ReplayFrame:
    """One pair of a recording.

    Parameters
    ----------
    number : int
        Counts from 1; part of the picture file names.
    stamp_ns : int
        Stamp of the left image.
    summary : FrameSummary
    stage_ms : mapping of str to float
        Milliseconds by stage, in order: the detector's stages, `CLOUDS` and `FILE_STAGES`.
    warnings : tuple of str
        What makes the pair less trustworthy.
    """

    number: int
    stamp_ns: int
    summary: FrameSummary
    stage_ms: Mapping[str, float]
    warnings: tuple[str, ...] = ()

    @property
    def detection_ms(self) -> float:
        """Milliseconds in the detector, without reading and writing."""
        return sum(ms for stage, ms in self.stage_ms.items() if stage not in FILE_STAGES)


@dataclass(frozen=True)
class ReplaySummary:
    """The replay of one recording.

    `notes` describe damage to a salvaged recording. `calibration` names the source of the
    calibration. `expected` is the number of pairs by the
    message counts; `interrupted` says whether some of them may be missing.
    """

    bag: str
    notes: tuple[str, ...]
    topics: StereoTopics
    calibration: str
    cameras: tuple[StereoCamera, ...]
    config: DetectorConfig
    statistics: PairingStatistics
    frames: tuple[ReplayFrame, ...]
    bad_frames: tuple[BadFrame, ...]
    expected: int
    interrupted: bool

    @property
    def done(self) -> int:
        """Number of pairs and bad messages that have been dealt with."""
        return len(self.frames) + len(self.bad_frames)

    @property
    def unjudgeable(self) -> int:
        """Number of bad frames that are pairs the detector cannot judge."""
        return sum(each.unjudgeable for each in self.bad_frames)

    @property
    def warnings(self) -> tuple[WarningCount, ...]:
        """Warnings of the frames, by kind."""
        return count_warnings((each.stamp_ns, each.warnings) for each in self.frames)

    @property
    def times(self) -> dict[str, StageTime]:
        """Time of each stage over all frames."""
        return stage_times(each.stage_ms for each in self.frames)

    @property
    def detection_time(self) -> StageTime:
        """Time in the detector over all frames."""
        return StageTime.of([each.detection_ms for each in self.frames])

    def as_json(self) -> dict[str, Any]:
        """Return the content of ``summary.json``."""
        statistics = self.statistics
        gap_ns = statistics.smallest_gap_ns
        return {
            **preamble('replay', self.config),
            'bag': self.bag,
            'notes': list(self.notes),
            'interrupted': self.interrupted,
            'topics': dataclasses.asdict(self.topics),
            'calibration': self.calibration,
            'cameras': [dataclasses.asdict(camera) for camera in self.cameras],
            'counts': {
                'left_images': statistics.left,
                'right_images': statistics.right,
                'pairs': statistics.pairs,
                'done': self.done,
                'expected': self.expected,
                'detected': len(self.frames),
                'bad': len(self.bad_frames),
                'unjudgeable': self.unjudgeable,
                'unmatched_left': statistics.unmatched_left,
                'unmatched_right': statistics.unmatched_right,
                'smallest_gap_s': None if gap_ns is None else gap_ns / 1e9,
            },
            'obstacles_per_frame': _spread([each.summary.obstacles for each in self.frames]),
            'stage_ms': {stage: dataclasses.asdict(time) for stage, time in self.times.items()},
            'detection_ms': dataclasses.asdict(self.detection_time),
            'warnings': [dataclasses.asdict(each) for each in self.warnings],
            'bad_frames': [dataclasses.asdict(each) for each in self.bad_frames],
            'frames': [
                {
                    'number': each.number,
                    'stamp_ns': each.stamp_ns,
                    **each.summary.as_json(),
                    'warnings': list(each.warnings),
                    'detection_ms': round(each.detection_ms, 3),
                    'stage_ms': {stage: round(ms, 3) for stage, ms in each.stage_ms.items()},
                }
                for each in self.frames
            ],
        }


def preamble(command: str, config: DetectorConfig) -> dict[str, Any]:
    """Return the keys common to all summaries: format, versions and parameters."""
    return {
        'format': f'rover_obstacle_detection {command}',
        'format_version': FORMAT_VERSION,
        'versions': versions(),
        'parameters': dataclasses.asdict(config),
    }


def versions() -> dict[str, str]:
    """Return the versions of this package, of Python, and of the libraries that decide."""
    return {
        'rover_obstacle_detection': __version__,
        'python': platform.python_version(),
        'numpy': metadata.version('numpy'),
        'opencv': cv2.__version__,
        'rosbags': metadata.version('rosbags'),
    }


def obstacle_json(obstacle: Obstacle) -> dict[str, Any]:
    """Return an obstacle's fields, with None instead of NaN."""
    return _finite(dataclasses.asdict(obstacle))


def _extreme(choose: Any, values: Iterable[float]) -> float:
    """Return the minimum or maximum of the finite values; NaN if there are none."""
    return float(choose(filter(math.isfinite, values), default=math.nan))


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {
        'mean': float(np.mean(values)),
        'min': float(np.min(values)),
        'max': float(np.max(values)),
    }


def _finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Replace NaN and infinity by None, also within tuples."""

    def clean(value: Any) -> Any:
        if isinstance(value, tuple):
            return [clean(each) for each in value]
        if isinstance(value, float) and not math.isfinite(value):
            return None
        return value

    return {name: clean(value) for name, value in numbers.items()}
