"""Training examples: features and labels of recorded or rendered frames."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.detection.images.resampling import resized
from rover_obstacle_detection.detection.methods.measurement import measure
from rover_obstacle_detection.detection.methods.outline_view import outline_view
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.rectification.correction import Correction
from rover_obstacle_detection.detection.rocks.outline_features import EVERYWHERE, outline_features
from rover_obstacle_detection.detection.rocks.standing import standing_parts
from rover_obstacle_detection.errors import BagError, UnjudgeablePairError
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import FREE, NOT_COUNTED, ROCK, connected
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics
from rover_obstacle_detection.simulation.cache import cache_folder, cached_bag, simulated_bag
from rover_obstacle_detection.simulation.suite import load_suite

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


def bags_of_suite(
    suite: str, is_chosen: Callable[[str], bool], *, cached_only: bool = False
) -> Iterator[Path]:
    """Render the chosen scenes of a suite, unless the cache has them already.

    Parameters
    ----------
    suite : str
    is_chosen : callable
        Takes the name of a scene.
    cached_only : bool
        Leave out the scenes that the cache does not have.

    Raises
    ------
    MissingExtraError
        If a scene must be rendered, and the extra ``sim`` is not installed.
    """
    folder = cache_folder()
    for scene in load_suite(suite):
        if is_chosen(scene.name) and (not cached_only or cached_bag(scene, folder).exists()):
            yield simulated_bag(scene, folder)


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


def straightened_labels(
    labels: NDArray[np.uint8], camera: StereoCamera, correction: Correction
) -> NDArray[np.uint8]:
    """Labels of the straightened left image at another resolution: what the features show.

    Parameters
    ----------
    labels : ndarray of uint8, shape (height, width)
        Of the left image.
    camera : StereoCamera
        Of the resolution of the outlines.
    correction : Correction
    """
    labels = resized(labels, camera.shape)
    if not correction.lenses.left:
        return labels
    left, _ = correction.lenses.views(camera)
    labels = left.straightened(labels, cv2.INTER_NEAREST).copy()
    labels[~left.seen(0)] = NOT_COUNTED
    return labels


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
