"""Studies of labelled bags, one bag per call.

Every function can run in a worker process. All raise `ObstacleDetectionError` if the bag, or any
of its frames, cannot be used.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rover_obstacle_detection.bags.reader import BagReader, bag_name, open_bag
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.errors import BagError, ConfigurationError
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.results import Evaluation
from rover_obstacle_detection.evaluation.runner import RunOptions
from rover_obstacle_detection.offline.evaluate import (
    BagOptions,
    condition_in,
    evaluate_bag,
    labelled_frames,
)
from rover_obstacle_detection.offline.labelled_bag import (
    TruthTopics,
    find_truth_topics,
    recorded_conditions,
    recorded_scene,
)
from studies.cloud_study import SceneClouds, compare_clouds
from studies.disparity_study import (
    SceneDisparity,
    frame_errors,
    summed,
)
from studies.gravity_study import SceneGravity, compare_gravity
from studies.lens_study import SceneLenses, compare_lenses
from studies.reliability import JudgedObstacles


def evaluate_scene(path: Path, options: RunOptions) -> Evaluation:
    """Run methods on a bag in which every frame must be usable."""
    evaluation = evaluate_bag(path, options, BagOptions(), lambda done, expected: None)
    if evaluation.problems:
        raise BagError('\n'.join(evaluation.problems))
    return evaluation


def study_disparity(path: Path, config: DetectorConfig) -> SceneDisparity:
    """Compare the disparity of the detector and of plain SGBM with the true depth."""
    with open_bag(path) as bag:
        truth = find_truth_topics(bag)
        errors = [frame_errors(frame, config) for frame in _frames(bag, truth)]
        return SceneDisparity(bag_name(path), _conditions(bag, truth), summed(errors))


def study_gravity(path: Path, config: DetectorConfig) -> SceneGravity:
    """Run the detector with known and with estimated gravity, on the frames with a true pose."""
    with open_bag(path) as bag:
        truth = find_truth_topics(bag)
        height_m = _camera_height_m(bag, truth)
        compared = [compare_gravity(frame, config, height_m) for frame in _frames(bag, truth)]
        frames = tuple(frame for frame in compared if frame is not None)
        return SceneGravity(bag_name(path), _conditions(bag, truth), frames)


def study_lenses(path: Path, config: DetectorConfig) -> list[SceneLenses]:
    """Run the detector on each frame with added lens distortion."""
    with open_bag(path) as bag:
        return [compare_lenses(frame, config) for frame in _frames(bag, find_truth_topics(bag))]


def study_clouds(path: Path, config: DetectorConfig) -> SceneClouds:
    """Compare the detector's obstacle clouds with the true depth."""
    with open_bag(path) as bag:
        return compare_clouds(bag_name(path), _frames(bag, find_truth_topics(bag)), config)


def study_reliability(path: Path, config: DetectorConfig) -> JudgedObstacles:
    """Check the detector's obstacles against the labels."""
    judged = JudgedObstacles(np.zeros(0), np.zeros(0, bool))
    with open_bag(path) as bag:
        for frame in _frames(bag, find_truth_topics(bag)):
            detection = Detector(frame.camera, config).detect(frame.left, frame.right)
            judged = judged + JudgedObstacles.of(detection, frame.labels)
    return judged


def _frames(bag: BagReader, truth: TruthTopics) -> Iterator[LabelledFrame]:
    frames, _ = labelled_frames(bag, truth, BagOptions())
    for frame in frames:
        if isinstance(frame, BadFrame):
            msg = f'{bag.path}: {frame.stamp_ns / 1e9:.3f} s: {frame.reason}'
            raise BagError(msg)
        yield frame


def _conditions(bag: BagReader, truth: TruthTopics) -> tuple[str, ...]:
    return recorded_conditions(bag, truth) or (condition_in(bag_name(bag.path)),)


def _camera_height_m(bag: BagReader, truth: TruthTopics) -> float | None:
    from rover_obstacle_detection.simulation.description import Scene

    try:
        return Scene.from_mapping(recorded_scene(bag, truth)).rig_used().camera_height_m
    except ConfigurationError:
        return None
