"""Run methods on labelled recordings and compute their figures."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from rover_obstacle_detection.bags.reader import BagReader, bag_name, open_bag
from rover_obstacle_detection.bags.requested_calibration import requested_calibration
from rover_obstacle_detection.bags.stereo import BadFrame, read_pairs
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.errors import (
    BagError,
    CameraError,
    ImageError,
    NothingDoneError,
    ObstacleDetectionError,
)
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.results import Evaluation, merged
from rover_obstacle_detection.evaluation.runner import RunOptions, SceneRun
from rover_obstacle_detection.messages.raw_images import BY_NAME
from rover_obstacle_detection.offline.labelled_bag import (
    TruthTopics,
    find_truth_topics,
    read_labelled,
    recorded_conditions,
)
from rover_obstacle_detection.offline.replay import Stopped, never_stopped

OnProgress = Callable[[int, int], None]
"""Called with the number of frames done and expected."""

OnBagProgress = Callable[[int, int, int], None]
"""Called with the bag's index and the number of frames done and expected."""

_Ended = tuple[int, Evaluation | ObstacleDetectionError]

_PREFIX = re.compile(r'^(?:(?:tuning|tune|reporting|report|scene|suite|\d+)[_-])+')


@dataclass(frozen=True)
class BagOptions:
    """How to read labelled recordings.

    Parameters
    ----------
    left_topic, right_topic, labels_topic : str, optional
        Found by name if omitted.
    rectify : str
        Which images are raw, one of `messages.raw_images.RECTIFY`.
    calibration : CalibrationRequest
        From the bag if nothing is given.
    every : int
        Use every n-th pair.
    conditions : sequence of str
        Conditions of the scene; from ``truth/scene`` or the recording's name if empty.
    """

    left_topic: str | None = None
    right_topic: str | None = None
    labels_topic: str | None = None
    rectify: str = BY_NAME
    calibration: CalibrationRequest = field(default_factory=CalibrationRequest)
    every: int = 1
    conditions: Sequence[str] = ()


def evaluate_bag(
    path: Path,
    run_options: RunOptions,
    bag_options: BagOptions,
    on_progress: OnProgress,
    name: str | None = None,
    stopped: Stopped = never_stopped,
) -> Evaluation:
    """Run the methods on one labelled recording.

    Parameters
    ----------
    path : Path
    run_options : RunOptions
    bag_options : BagOptions
    on_progress : callable
    name : str, optional
        Name of the scene; the recording's if omitted.
    stopped : callable, optional
        Asked before each frame whether to give up.

    Raises
    ------
    NothingDoneError
        If it is stopped.
    ObstacleDetectionError
        If the recording cannot be read, has no labels or has no usable frame.
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
            if stopped():
                raise NothingDoneError(f'{path} is not evaluated')
            if isinstance(frame, BadFrame):
                problems.append(f'{path}: {frame.stamp_ns / 1e9:.3f} s: {frame.reason}')
                continue
            run.take(frame)
            done += 1
            on_progress(done, max(done, expected))
    if not done:
        reason = f': {problems[0]}' if problems else ': no pairs of left and right images'
        raise BagError(f'{path}: no labelled frame{reason}')
    return run.evaluation(problems)


def evaluate_bags(
    paths: Sequence[Path],
    run_options: RunOptions,
    bag_options: BagOptions,
    on_progress: OnBagProgress,
    stopped: Stopped = never_stopped,
    scheduler: str = '',
) -> tuple[Evaluation, list[ObstacleDetectionError]]:
    """Run the methods on several recordings; if one fails, the others are still evaluated.

    Parameters
    ----------
    paths : sequence of Path
    run_options : RunOptions
    bag_options : BagOptions
    on_progress : callable
    stopped : callable, optional
        Asked before each frame; recordings that are not done then are left out.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers evaluate the recordings.

    Returns
    -------
    evaluation : Evaluation
        In the order of the recordings.
    errors : list of ObstacleDetectionError
        One for each recording that failed or is left out, in their order.

    Raises
    ------
    ClusterError
        If the scheduler cannot be reached.
    MissingExtraError
        If there is a scheduler and dask.distributed is not installed.
    """
    if scheduler:
        results = _on_cluster(scheduler, paths, run_options, bag_options, on_progress, stopped)
    else:
        results = _one_by_one(paths, run_options, bag_options, on_progress, stopped)
    parts, errors = [], []
    for _, result in sorted(results, key=lambda each: each[0]):
        if isinstance(result, Evaluation):
            parts.append(result)
        else:
            errors.append(result)
    return merged(parts, run_options.worst_pictures), errors


def _one_by_one(
    paths: Sequence[Path],
    run_options: RunOptions,
    bag_options: BagOptions,
    on_progress: OnBagProgress,
    stopped: Stopped,
) -> Iterator[_Ended]:
    for index, (path, name) in enumerate(zip(paths, scene_names(paths), strict=True)):
        if stopped():
            yield index, NothingDoneError(f'{path} is not evaluated')
            continue
        progress = functools.partial(on_progress, index)
        result: Evaluation | ObstacleDetectionError
        try:
            result = evaluate_bag(path, run_options, bag_options, progress, name, stopped)
        except (BagError, CameraError, ImageError, NothingDoneError) as error:
            result = error
        yield index, result


def _on_cluster(
    scheduler: str,
    paths: Sequence[Path],
    run_options: RunOptions,
    bag_options: BagOptions,
    on_progress: OnBagProgress,
    stopped: Stopped,
) -> Iterator[_Ended]:
    from rover_obstacle_detection.offline.cluster import run_on_cluster
    from rover_obstacle_detection.offline.cluster_worker import BagWork

    calibration = bag_options.calibration.absolute()
    bag_options = replace(bag_options, calibration=calibration)
    works = []
    for path, name in zip(paths, scene_names(paths), strict=True):
        there = path.absolute()
        run = functools.partial(_evaluate_on_worker, there, run_options, bag_options, name)
        works.append(BagWork(str(path), (there, *calibration.files), run))
    return run_on_cluster(scheduler, works, on_progress, stopped)


def _evaluate_on_worker(
    path: Path,
    run_options: RunOptions,
    bag_options: BagOptions,
    name: str,
    on_progress: OnProgress,
    stopped: Stopped,
    is_again: bool,
) -> Evaluation:
    return evaluate_bag(path, run_options, bag_options, on_progress, name, stopped)


def labelled_frames(
    bag: BagReader, truth: TruthTopics, options: BagOptions
) -> tuple[Iterator[LabelledFrame | BadFrame], int]:
    """Read the pairs of a recording with their ground truth.

    Returns
    -------
    frames : iterator of LabelledFrame or BadFrame
    expected : int
        Largest possible number of frames, from the message counts.

    Raises
    ------
    ObstacleDetectionError
        If there is no stereo camera or no calibration.
    """
    topics = bag.stereo_topics(left_image=options.left_topic, right_image=options.right_topic)
    topics = replace(topics, rectify=options.rectify)
    pairs = read_pairs(
        bag,
        topics,
        calibration=requested_calibration(options.calibration, bag, topics),
        every=options.every,
        extra_topics=truth.stamped,
    )
    return read_labelled(pairs, truth), _expected_frames(bag, topics, options.every)


def scene_names(paths: Sequence[Path]) -> list[str]:
    """Name recordings; those with the same name get their parent folder in front."""
    names = [bag_name(path) for path in paths]
    return [
        f'{path.resolve().parent.name}/{name}' if names.count(name) > 1 else name
        for path, name in zip(paths, names, strict=True)
    ]


def condition_in(scene: str) -> str:
    """Return a scene's name without prefixes such as ``report_`` and ``07_``."""
    return _PREFIX.sub('', scene) or scene


def _expected_frames(bag: BagReader, topics: StereoTopics, every: int) -> int:
    count = min(bag.message_count(topics.left_image), bag.message_count(topics.right_image))
    return -(-count // every)
