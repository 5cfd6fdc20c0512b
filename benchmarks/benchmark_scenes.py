"""The stereo pairs that the benchmark measures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import StereoPair, read_pairs
from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.plain_stereo import plain_stereo_seconds
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics
from rover_obstacle_detection.simulation.cache import cache_folder, cached_bag
from rover_obstacle_detection.simulation.suite import load_suite

BAGS = Path(__file__).resolve().parent.parent / 'bags'
STANDARD = (1024, 768)
"""Width and height of the images for which the targets hold."""

Pair = StereoPair | LabelledFrame


@dataclass(frozen=True)
class Scene:
    """A pair and where it comes from."""

    name: str
    pair: Pair

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the images."""
        return self.pair.camera.width, self.pair.camera.height


def default_bags() -> list[Path]:
    """Return the sample bags, and the reporting scenes that are in the cache already."""
    samples = sorted(path for path in BAGS.iterdir() if path.is_dir())
    cached = (
        cached_bag(scene, cache_folder())
        for scene in load_suite('standard')
        if scene.name.startswith('report_')
    )
    return samples + [path for path in cached if path.exists()]


def read_scenes(bags: Sequence[Path], frames_per_bag: int | None = None) -> list[Scene]:
    """Read the pairs of all bags, with labels where they have some."""
    return [
        Scene(f'{path.resolve().name} {number}', pair)
        for path in bags
        for number, pair in enumerate(islice(pairs_of(path), frames_per_bag))
    ]


def pairs_of(path: Path) -> Iterator[Pair]:
    """Labelled frames of a bag, or its pairs where it has no labels."""
    with open_bag(path) as bag:
        try:
            frames, _ = labelled_frames(bag, find_truth_topics(bag), BagOptions())
        except BagError:
            frames = read_pairs(bag, bag.stereo_topics())
        yield from (each for each in frames if isinstance(each, StereoPair | LabelledFrame))


def standard_scenes(scenes: Sequence[Scene]) -> list[Scene]:
    """Choose the scenes of 1024 x 768 pixels; if there is none, resize the first one."""
    found = [scene for scene in scenes if scene.size == STANDARD]
    return found or [Scene(f'{scenes[0].name}, resized', resized(scenes[0].pair, *STANDARD))]


def resized(pair: Pair, width: int, height: int) -> StereoPair:
    """Resize a pair and its camera; without labels."""
    how = cv2.INTER_AREA if width < pair.camera.width else cv2.INTER_CUBIC
    left, right = (
        np.asarray(cv2.resize(image, (width, height), interpolation=how))
        for image in (pair.left, pair.right)
    )
    camera = pair.camera.resized(width, height)
    return StereoPair(pair.stamp_ns, '', left, right, left_header=None, camera=camera)


def plain_seconds(pair: Pair) -> float:
    """Return the yardstick: seconds of one plain SGBM call on a pair."""
    return plain_stereo_seconds(pair.camera, pair.left, pair.right)
