"""Labelled recordings in memory, evaluated once per trial."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.errors import BagError, ConfigurationError, UnjudgeablePairError
from rover_obstacle_detection.evaluation.figures import Figures, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import is_obstacle
from rover_obstacle_detection.evaluation.results import total
from rover_obstacle_detection.offline.evaluate import (
    BagOptions,
    OnBagProgress,
    OnProgress,
    labelled_frames,
    scene_names,
)
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics
from rover_obstacle_detection.wording import counted

MEGABYTE = 1_000_000


@dataclass(frozen=True, eq=False)
class TuningScene:
    """The labelled frames of one recording.

    Parameters
    ----------
    name : str
    path : Path
    frames : tuple of LabelledFrame
        Grey images, without depth.
    problems : tuple of str
        Messages about frames that were skipped.
    """

    name: str
    path: Path
    frames: tuple[LabelledFrame, ...]
    problems: tuple[str, ...] = ()

    @property
    def memory_bytes(self) -> int:
        """Memory the frames take."""
        return sum(map(_frame_bytes, self.frames))

    @property
    def has_obstacles(self) -> bool:
        """Whether any pixel is labelled as an obstacle."""
        return any(is_obstacle(frame.labels).any() for frame in self.frames)


def read_scenes(
    paths: Sequence[Path], options: BagOptions, max_bytes: int, on_progress: OnBagProgress
) -> list[TuningScene]:
    """Read recordings into memory.

    Raises
    ------
    ObstacleDetectionError
        If a recording cannot be read or has no usable labelled frame, or if the recordings need
        more than `max_bytes`. The memory is estimated from the first frame of each.
    """
    scenes: list[TuningScene] = []
    for index, (path, name) in enumerate(zip(paths, scene_names(paths), strict=True)):
        free_bytes = max_bytes - sum(scene.memory_bytes for scene in scenes)
        progress = functools.partial(on_progress, index)
        scenes.append(_read_scene(path, name, options, free_bytes, progress))
    return scenes


def figures_of(config: DetectorConfig, scene: TuningScene) -> Figures:
    """Run the detector over a scene and pool the figures of its frames."""
    return total(
        score(_mask(config, frame), frame.labels, frame.instances) for frame in scene.frames
    )


def _mask(config: DetectorConfig, frame: LabelledFrame) -> NDArray[np.uint8]:
    try:
        return Detector(frame.camera, config).detect(frame.left, frame.right).mask
    except UnjudgeablePairError:
        # All is unknown, so no obstacle is found.
        return np.zeros(frame.camera.shape, np.uint8)


def _read_scene(
    path: Path, name: str, options: BagOptions, max_bytes: int, on_progress: OnProgress
) -> TuningScene:
    frames: list[LabelledFrame] = []
    problems: list[str] = []
    with open_bag(path) as bag:
        problems += bag.notes
        truth = find_truth_topics(bag, options.labels_topic)
        found, expected = labelled_frames(bag, truth, options)
        # Recordings are often only partly labelled.
        expected = min(expected, bag.message_count(truth.labels))
        for frame in found:
            if isinstance(frame, BadFrame):
                problems.append(f'{path}: {frame.stamp_ns / 1e9:.3f} s: {frame.reason}')
                continue
            frames.append(_compact(frame))
            count = max(expected, len(frames))
            needed_bytes = count * _frame_bytes(frames[0])
            if needed_bytes > max_bytes:
                msg = (
                    f'{path}: {counted(count, "frame")} would take '
                    f'{needed_bytes / MEGABYTE:.0f} MB, but {max_bytes / MEGABYTE:.0f} MB are '
                    'free: read fewer with --every N, or allow more with --memory MB'
                )
                raise ConfigurationError(msg)
            on_progress(len(frames), count)
    if not frames:
        reason = f': {problems[0]}' if problems else ': no pairs of left and right images'
        msg = f'{path}: no labelled frame{reason}'
        raise BagError(msg)
    return TuningScene(name, path, tuple(frames), tuple(problems))


def _compact(frame: LabelledFrame) -> LabelledFrame:
    """Drop what neither the detector nor the score uses."""
    left, right = grey_pair(frame.left, frame.right, frame.camera)
    return replace(frame, left=left, right=right, depth_m=None)


def _frame_bytes(frame: LabelledFrame) -> int:
    return sum(each.nbytes for each in (frame.left, frame.right, frame.labels, frame.instances))
