"""Labelled recordings read once and kept in memory, to be looked at with many parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.errors import BagError, ConfigurationError
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

MEGABYTE = 1_000_000


@dataclass(frozen=True, eq=False)
class TuningScene:
    """A recording's labelled frames.

    Parameters
    ----------
    name : str
    path : Path
    frames : tuple of LabelledFrame
        Grey, and without depth.
    problems : tuple of str
        What could not be used.
    """

    name: str
    path: Path
    frames: tuple[LabelledFrame, ...]
    problems: tuple[str, ...] = ()

    @property
    def memory_bytes(self) -> int:
        """What the frames take."""
        return sum(map(_frame_bytes, self.frames))

    @property
    def has_obstacles(self) -> bool:
        """Whether there is anything to find."""
        return any(is_obstacle(frame.labels).any() for frame in self.frames)


def read_scenes(
    paths: Sequence[Path], options: BagOptions, max_bytes: int, on_progress: OnBagProgress
) -> list[TuningScene]:
    """Read recordings, a scene each.

    Raises
    ------
    ObstacleDetectionError
        If one cannot be read, has no labels or no frame that can be used, or if together they
        take more memory than allowed: as soon as that can be told.
    """
    scenes: list[TuningScene] = []
    for index, (path, name) in enumerate(zip(paths, scene_names(paths), strict=True)):

        def progress(done: int, expected: int, index: int = index) -> None:
            on_progress(index, done, expected)

        left_bytes = max_bytes - sum(scene.memory_bytes for scene in scenes)
        scenes.append(_read_scene(path, name, options, left_bytes, progress))
    return scenes


def figures_of(config: DetectorConfig, scene: TuningScene) -> Figures:
    """Run the detector over a scene, and pool the figures of its frames."""
    return total(
        score(
            Detector(frame.camera, config).detect(frame.left, frame.right).mask,
            frame.labels,
            frame.instances,
        )
        for frame in scene.frames
    )


def _read_scene(
    path: Path, name: str, options: BagOptions, max_bytes: int, on_progress: OnProgress
) -> TuningScene:
    frames: list[LabelledFrame] = []
    problems: list[str] = []
    with open_bag(path) as bag:
        problems += bag.notes
        truth = find_truth_topics(bag, options.labels_topic)
        found, expected = labelled_frames(bag, truth, options)
        # Often only some of the images have labels.
        expected = min(expected, bag.message_count(truth.labels))
        for frame in found:
            if isinstance(frame, BadFrame):
                problems.append(f'{path}: {frame.stamp_ns / 1e9:.3f} s: {frame.reason}')
                continue
            frames.append(_compact(frame))
            needed_bytes = max(expected, len(frames)) * _frame_bytes(frames[0])
            if needed_bytes > max_bytes:
                msg = (
                    f'{path}: its {max(expected, len(frames))} frames take '
                    f'{needed_bytes / MEGABYTE:.0f} MB, and there is room for '
                    f'{max_bytes / MEGABYTE:.0f}: take fewer with --every N, or allow more with '
                    '--memory MB'
                )
                raise ConfigurationError(msg)
            on_progress(len(frames), max(len(frames), expected))
    if not frames:
        reason = f': {problems[0]}' if problems else ': no pairs of left and right images'
        msg = f'{path}: no labelled frame{reason}'
        raise BagError(msg)
    return TuningScene(name, path, tuple(frames), tuple(problems))


def _compact(frame: LabelledFrame) -> LabelledFrame:
    """Leave out what neither the detector nor the score looks at."""
    left, right = grey_pair(frame.left, frame.right, frame.camera)
    return replace(frame, left=left, right=right, depth_m=None)


def _frame_bytes(frame: LabelledFrame) -> int:
    return sum(each.nbytes for each in (frame.left, frame.right, frame.labels, frame.instances))
