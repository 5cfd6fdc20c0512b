"""Methods over labelled recordings: figures, curves, distributions, pictures."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from rover_obstacle_detection.bags.reader import BagReader, open_bag
from rover_obstacle_detection.bags.stereo import BadFrame, read_pairs
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.errors import BagError, CameraError, ImageError
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.results import Evaluation, merged
from rover_obstacle_detection.evaluation.runner import RunOptions, SceneRun
from rover_obstacle_detection.messages.calibration import load_stereo_calibration
from rover_obstacle_detection.offline.labelled_bag import (
    TruthTopics,
    find_truth_topics,
    read_labelled,
    recorded_conditions,
)

OnProgress = Callable[[int, int], None]
"""Called with the frames done and the frames expected."""

OnBagProgress = Callable[[int, int, int], None]
"""Called with the bag's index, the frames done and the frames expected."""

_PREFIX = re.compile(r'^(?:(?:tuning|tune|reporting|report|scene|suite|\d+)[_-])+')


@dataclass(frozen=True)
class BagOptions:
    """What to read of a recording.

    Parameters
    ----------
    left_topic, right_topic, labels_topic : str, optional
        Found by their names if not given.
    calibration : tuple of Path, optional
        Calibration files of the left and the right camera; from the bag if not given.
    every : int
        Take every n-th pair.
    conditions : sequence of str
        The scene's conditions; as the recording says, or from its
        name, if not given.
    """

    left_topic: str | None = None
    right_topic: str | None = None
    labels_topic: str | None = None
    calibration: tuple[Path, Path] | None = None
    every: int = 1
    conditions: Sequence[str] = ()


def evaluate_bag(
    path: Path,
    run_options: RunOptions,
    bag_options: BagOptions,
    on_progress: OnProgress,
    name: str | None = None,
) -> Evaluation:
    """Run the methods over one labelled recording, a scene.

    Parameters
    ----------
    path : Path
    run_options : RunOptions
    bag_options : BagOptions
    on_progress : callable
    name : str, optional
        The scene's; the recording's if not given.

    Raises
    ------
    ObstacleDetectionError
        If the recording cannot be read, has no labels, or none of its frames can be used.
    """
    scene = name or bag_name(path)
    problems: list[str] = []
    done = 0
    with open_bag(path) as bag:
        problems += bag.notes
        truth = find_truth_topics(bag, bag_options.labels_topic)
        conditions = tuple(bag_options.conditions) or recorded_conditions(bag, truth)
        run = SceneRun(scene, conditions or (condition_in(scene),), run_options)
        frames, expected = labelled_frames(bag, truth, bag_options)
        for frame in frames:
            if isinstance(frame, BadFrame):
                problems.append(f'{path}: {frame.stamp_ns / 1e9:.3f} s: {frame.reason}')
                continue
            run.take(frame)
            done += 1
            on_progress(done, max(done, expected))
    if not done:
        reason = f': {problems[0]}' if problems else ': no pairs of left and right images'
        msg = f'{path}: no labelled frame{reason}'
        raise BagError(msg)
    return run.evaluation(problems)


def evaluate_bags(
    paths: Sequence[Path],
    run_options: RunOptions,
    bag_options: BagOptions,
    on_progress: OnBagProgress,
) -> tuple[Evaluation, list[str]]:
    """Run the methods over several recordings; one that fails does not hold up the others.

    Returns
    -------
    evaluation : Evaluation
    errors : list of str
        Of the recordings that failed.
    """
    parts, errors = [], []
    for index, (path, name) in enumerate(zip(paths, scene_names(paths), strict=True)):
        progress = functools.partial(on_progress, index)
        try:
            parts.append(evaluate_bag(path, run_options, bag_options, progress, name))
        except (BagError, CameraError, ImageError) as error:
            errors.append(str(error))
    return merged(parts, run_options.worst_pictures), errors


def labelled_frames(
    bag: BagReader, truth: TruthTopics, options: BagOptions
) -> tuple[Iterator[LabelledFrame | BadFrame], int]:
    """Read a recording's pairs with their truth.

    Returns
    -------
    frames : iterator of LabelledFrame or BadFrame
    expected : int
        How many there are at most, as far as the counts of messages tell.

    Raises
    ------
    ObstacleDetectionError
        If there are no pairs, or no calibration.
    """
    topics = bag.stereo_topics(left_image=options.left_topic, right_image=options.right_topic)
    files = options.calibration
    pairs = read_pairs(
        bag,
        topics,
        calibration=load_stereo_calibration(*files) if files else None,
        every=options.every,
        extra_topics=truth.stamped,
    )
    return read_labelled(pairs, truth), _expected_frames(bag, topics, options.every)


def scene_names(paths: Sequence[Path]) -> list[str]:
    """Name recordings, those of the same name with the folder that they are in."""
    names = [bag_name(path) for path in paths]
    return [
        f'{path.resolve().parent.name}/{name}' if names.count(name) > 1 else name
        for path, name in zip(paths, names, strict=True)
    ]


def bag_name(path: Path) -> str:
    """Name of a recording: of its folder, or of its file without the ending."""
    resolved = path.resolve()
    return resolved.name if resolved.is_dir() else resolved.stem


def condition_in(scene: str) -> str:
    """Condition that a scene's name tells: the name without ``reporting_``, ``07_`` and such."""
    return _PREFIX.sub('', scene) or scene


def _expected_frames(bag: BagReader, topics: StereoTopics, every: int) -> int:
    count = min(bag.message_count(topics.left_image), bag.message_count(topics.right_image))
    return -(-count // every)
