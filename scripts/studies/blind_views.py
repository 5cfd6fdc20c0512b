"""Views of recordings for the study of blind conditions, with their truth."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from rover_obstacle_detection.bags.reader import BagReader, open_bag
from rover_obstacle_detection.bags.stereo import BadFrame, StereoPair, read_pairs
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import BagError, ObstacleDetectionError
from rover_obstacle_detection.evaluation.blind.view import View
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import FREE, NOT_COUNTED, ROCK
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import LABELS, find_truth_topics
from rover_obstacle_detection.swapped_images import detect_unswapped

Judge = Callable[[View], Detection]


def detector(config: DetectorConfig) -> Judge:
    """Make the detector that node and replay run, with their check for exchanged images."""

    def judge(view: View) -> Detection:
        return detect_unswapped(
            Detector(view.camera, config),
            view.left,
            view.right,
            'left',
            'right',
            gravity=view.told_gravity,
        )

    return judge


def views(bags: Sequence[Path], judge: Judge, frames: int | None = None) -> list[View]:
    """Read the views of recordings.

    Parameters
    ----------
    bags : sequence of Path
        Labelled or not. Without labels, what the detector says of the undamaged pair is the truth.
    judge : callable
        The detector; also estimates the vertical of pairs without a recorded one.
    frames : int, optional
        Use this many pairs of each recording; all if omitted.

    Raises
    ------
    ObstacleDetectionError
        If a recording cannot be read or has no usable pair.
    """
    pairs = [pair for bag in bags for pair in _pairs(bag, frames)]
    return [
        _view(pair, pairs[(index + 1) % len(pairs)], judge) for index, pair in enumerate(pairs)
    ]


def _pairs(path: Path, frames: int | None) -> list[LabelledFrame | StereoPair]:
    with open_bag(path) as bag:
        found = list(itertools.islice(_read(bag), frames))
    if not found:
        raise BagError(f'{path}: no pairs of left and right images')
    return found


def _read(bag: BagReader) -> Iterator[LabelledFrame | StereoPair]:
    labelled = any(f'/{topic}'.endswith(f'/{LABELS}') for topic in bag.topics)
    pairs: Iterator[LabelledFrame | StereoPair | BadFrame]
    if labelled:
        pairs, _ = labelled_frames(bag, find_truth_topics(bag), BagOptions())
    else:
        pairs = read_pairs(bag, bag.stereo_topics())
    for pair in pairs:
        if isinstance(pair, BadFrame):
            raise BagError(f'{bag.path}: {pair.stamp_ns / 1e9:.3f} s: {pair.reason}')
        yield pair


def _view(
    pair: LabelledFrame | StereoPair, other: LabelledFrame | StereoPair, judge: Judge
) -> View:
    # A single pair has no other moment; upside down, its right image shows something else.
    another = other.right if other is not pair else np.ascontiguousarray(pair.right[::-1, ::-1])
    if isinstance(pair, LabelledFrame) and pair.gravity is not None:
        return View.of(pair, another)
    bare = pair if isinstance(pair, LabelledFrame) else _unlabelled(pair)
    view = View.of(bare, another)
    try:
        reference = judge(view)
    except ObstacleDetectionError:
        return view
    if isinstance(pair, StereoPair):
        bare = referred_to(bare, reference)
    return View.of(bare, another, Gravity(reference.ground.up))


def referred_to(frame: LabelledFrame, reference: Detection) -> LabelledFrame:
    """Take what a detection says of a frame for its truth, where it was judged."""
    obstacle = reference.mask != 0
    labels = np.where(reference.known, FREE, NOT_COUNTED)
    labels[obstacle] = ROCK
    depth_m = np.full(labels.shape, np.nan, np.float32)
    measured = reference.known & (reference.disparity > 0)
    scale = frame.camera.fx * frame.camera.baseline_m
    depth_m[measured] = scale / reference.disparity[measured]
    return LabelledFrame(
        stamp_ns=frame.stamp_ns,
        camera=frame.camera,
        left=frame.left,
        right=frame.right,
        labels=labels.astype(np.uint8),
        instances=frame.instances,
        depth_m=depth_m,
        gravity=frame.gravity,
    )


def _unlabelled(pair: StereoPair) -> LabelledFrame:
    shape = pair.camera.shape
    return LabelledFrame(
        stamp_ns=pair.stamp_ns,
        camera=pair.camera,
        left=pair.left,
        right=pair.right,
        labels=np.full(shape, NOT_COUNTED, np.uint8),
        instances=np.zeros(shape, np.uint16),
    )
