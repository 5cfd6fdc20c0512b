"""``summary.json``: what went in, what came out and how long it took.

``docs/replay.md`` tells what each key means. Numbers that do not exist (the distance of an
obstacle without 3D) are null, so that every JSON reader takes the file.
"""

from __future__ import annotations

import dataclasses
import json
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

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

FORMAT_VERSION = 1

READ = 'read'
WRITE_BAG = 'write bag'
WRITE_IMAGES = 'write images'
FILE_STAGES = (READ, WRITE_BAG, WRITE_IMAGES)


@dataclass(frozen=True)
class FrameSummary:
    """One pair's result in numbers.

    Parameters
    ----------
    obstacles : int
    obstacle_share, matched_share, unknown_share : float
        Shares of the image's pixels: on obstacles, with disparity, not judged.
    nearest_obstacle_m : float
        Distance of the nearest obstacle's nearest point from the left eye; NaN where none.
    tallest_obstacle_m : float
        Greatest height above the local ground; NaN where none.
    camera_pitch_deg, camera_height_m : float
        Of the optical axis below the horizon, and of the left eye above the ground in view.
    rows_off_px, lens_bend_px : float
        What was made good of the rectification: rows by which a side of the right image is off,
        and how far a lens moves pixels, mean over the image.
    """

    obstacles: int
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
        """Sum up a detection."""
        obstacles = detection.obstacles
        return cls(
            obstacles=len(obstacles),
            obstacle_share=float(np.mean(detection.mask == OBSTACLE)),
            matched_share=float(np.mean(detection.disparity > 0)),
            unknown_share=float(np.mean(~detection.known)),
            nearest_obstacle_m=_extreme(min, [each.range_m for each in obstacles]),
            tallest_obstacle_m=_extreme(max, [each.max_height_m for each in obstacles]),
            camera_pitch_deg=detection.ground.pitch_deg,
            camera_height_m=detection.ground.height_m,
            rows_off_px=detection.alignment.most_px(detection.camera),
            lens_bend_px=detection.lenses.mean_bend_px(detection.camera),
        )

    def as_json(self) -> dict[str, Any]:
        """Return the figures, null where there is none."""
        return _finite(dataclasses.asdict(self))


@dataclass(frozen=True)
class ReplayFrame:
    """One pair of a recording.

    Parameters
    ----------
    number : int
        From 1; the number in the names of its pictures.
    stamp_ns : int
        The left image's stamp.
    summary : FrameSummary
    stage_ms : mapping of str to float
        Milliseconds by stage, in order: the detector's, and those of `FILE_STAGES`.
    """

    number: int
    stamp_ns: int
    summary: FrameSummary
    stage_ms: Mapping[str, float]

    @property
    def detection_ms(self) -> float:
        """Milliseconds of the detector, without reading and writing."""
        return sum(ms for stage, ms in self.stage_ms.items() if stage not in FILE_STAGES)


@dataclass(frozen=True)
class ReplaySummary:
    """The replay of one recording; `notes` say what is wrong with it although it was read."""

    bag: str
    notes: tuple[str, ...]
    topics: StereoTopics
    cameras: tuple[StereoCamera, ...]
    config: DetectorConfig
    statistics: PairingStatistics
    frames: tuple[ReplayFrame, ...]
    bad_frames: tuple[BadFrame, ...]

    @property
    def times(self) -> dict[str, StageTime]:
        """Milliseconds of each stage over all frames."""
        return stage_times(each.stage_ms for each in self.frames)

    @property
    def detection_time(self) -> StageTime:
        """Milliseconds of the detector over all frames."""
        return StageTime.of([each.detection_ms for each in self.frames])

    def as_json(self) -> dict[str, Any]:
        """Return the content of ``summary.json``."""
        statistics = self.statistics
        gap_ns = statistics.smallest_gap_ns
        return {
            **preamble('replay', self.config),
            'bag': self.bag,
            'notes': list(self.notes),
            'topics': dataclasses.asdict(self.topics),
            'cameras': [dataclasses.asdict(camera) for camera in self.cameras],
            'counts': {
                'left_images': statistics.left,
                'right_images': statistics.right,
                'pairs': statistics.pairs,
                'detected': len(self.frames),
                'bad': len(self.bad_frames),
                'unmatched_left': statistics.unmatched_left,
                'unmatched_right': statistics.unmatched_right,
                'smallest_gap_s': None if gap_ns is None else gap_ns / 1e9,
            },
            'obstacles_per_frame': _spread([each.summary.obstacles for each in self.frames]),
            'stage_ms': {stage: dataclasses.asdict(time) for stage, time in self.times.items()},
            'detection_ms': dataclasses.asdict(self.detection_time),
            'bad_frames': [
                {'stamp_ns': each.stamp_ns, 'topic': each.topic, 'reason': each.reason}
                for each in self.bad_frames
            ],
            'frames': [
                {
                    'number': each.number,
                    'stamp_ns': each.stamp_ns,
                    **each.summary.as_json(),
                    'detection_ms': round(each.detection_ms, 3),
                    'stage_ms': {stage: round(ms, 3) for stage, ms in each.stage_ms.items()},
                }
                for each in self.frames
            ],
        }


def preamble(command: str, config: DetectorConfig) -> dict[str, Any]:
    """Return the keys that every summary starts with: format, versions, parameters."""
    return {
        'format': f'rover_obstacle_detection {command}',
        'format_version': FORMAT_VERSION,
        'versions': {
            'rover_obstacle_detection': __version__,
            'python': platform.python_version(),
            'numpy': metadata.version('numpy'),
            'opencv': _opencv_version(),
            'rosbags': metadata.version('rosbags'),
        },
        'parameters': dataclasses.asdict(config),
    }


def obstacle_json(obstacle: Obstacle) -> dict[str, Any]:
    """Return an obstacle's numbers: boxes in pixels and metres, height, distance, confidence."""
    return _finite(dataclasses.asdict(obstacle))


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a summary; a number that is not finite is a mistake and raises ValueError."""
    text = json.dumps(content, indent=2, allow_nan=False)
    path.write_text(text + '\n', encoding='utf-8')


def _opencv_version() -> str:
    import cv2

    return str(cv2.__version__)


def _extreme(choose: Any, values: Sequence[float]) -> float:
    return float(choose((each for each in values if math.isfinite(each)), default=math.nan))


def _spread(values: Sequence[float]) -> dict[str, float]:
    if not values:
        return {}
    return {
        'mean': float(np.mean(values)),
        'min': float(np.min(values)),
        'max': float(np.max(values)),
    }


def _finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Replace numbers that are not finite by None, also within tuples."""

    def clean(value: Any) -> Any:
        if isinstance(value, tuple):
            return [clean(each) for each in value]
        if isinstance(value, float) and not math.isfinite(value):
            return None
        return value

    return {name: clean(value) for name, value in numbers.items()}
