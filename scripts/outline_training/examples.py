"""Training examples: features and labels of recorded or rendered frames."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from training_bags import straightened_labels

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.detection.methods.measurement import measure
from rover_obstacle_detection.detection.methods.outline_view import outline_view
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rocks.outline_features import EVERYWHERE, outline_features
from rover_obstacle_detection.detection.rocks.standing import standing_parts
from rover_obstacle_detection.errors import BagError, UnjudgeablePairError
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import FREE, ROCK, connected
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics

_PLACES_PER_PART = 40


@dataclass(frozen=True, eq=False)
class Example:
    """A labelled frame as the network is trained on it.

    Parameters
    ----------
    features : Tensor of float16, shape (features, height, width)
    rock : Tensor of bool, shape (height, width)
        Pixels labelled as rock.
    counted : Tensor of bool, shape (height, width)
        Pixels labelled as rock or as free. The detector finds slopes and drops by other means, so
        its output there does not matter.
    places : ndarray of int, shape (n, 2)
        Rows and columns on rocks, and on whatever else stands up.
    """

    features: torch.Tensor
    rock: torch.Tensor
    counted: torch.Tensor
    places: NDArray[np.intp]


def examples_of_bags(paths: Iterable[Path]) -> list[Example]:
    """Make examples of all labelled frames of recordings, and name the frames that are skipped.

    Parameters
    ----------
    paths : iterable of Path

    Raises
    ------
    ObstacleDetectionError
        If a recording cannot be read or has no labels.
    """
    examples = []
    for path in paths:
        print(f'reading {path.name}', file=sys.stderr)
        has_labels = False
        with open_bag(path) as bag:
            frames, _ = labelled_frames(bag, find_truth_topics(bag), BagOptions())
            for frame in frames:
                if isinstance(frame, BadFrame):
                    print(f'skipped: {path}: {frame.reason}', file=sys.stderr)
                    continue
                has_labels = True
                try:
                    examples.append(example_of(frame))
                except UnjudgeablePairError as error:
                    print(f'skipped: {path}: {error}', file=sys.stderr)
        if not has_labels:
            msg = f'{path}: no labelled frame'
            raise BagError(msg)
    return examples


def example_of(frame: LabelledFrame) -> Example:
    """Compute a frame's features as the detector does where gravity is not known.

    Raises
    ------
    UnjudgeablePairError
        If the pair says nothing about the ground, or contradicts itself.
    """
    parameters = DetectorParameters.from_config(DetectorConfig())
    full = Frame(grey_pair(frame.left, frame.right, frame.camera), frame.camera)
    view = outline_view(full, measure(full, parameters), parameters)
    standing = standing_parts(view.terrain, parameters.rocks)
    features = outline_features(view.stereo, view.terrain, standing, EVERYWHERE, parameters.rocks)
    labels = straightened_labels(frame.labels, view.frame.camera, view.correction)
    rock = labels == ROCK
    return Example(
        torch.from_numpy(features.astype(np.float16)),
        torch.from_numpy(rock),
        torch.from_numpy(rock | (labels == FREE)),
        even_places(rock | (standing.parts > 0)),
    )


def even_places(where: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Draw the same number of pixels from each connected part, as far as it has that many.

    Parameters
    ----------
    where : ndarray of bool, shape (height, width)

    Returns
    -------
    ndarray of int, shape (n, 2)
        Rows and columns.
    """
    parts = connected(where).ravel()
    pixels = np.random.default_rng(0).permutation(np.flatnonzero(parts))
    pixels = pixels[np.argsort(parts[pixels], kind='stable')]
    _, first, count = np.unique(parts[pixels], return_index=True, return_counts=True)
    rank = np.arange(len(pixels)) - np.repeat(first, count)
    return np.stack(np.unravel_index(pixels[rank < _PLACES_PER_PART], where.shape), axis=1)
