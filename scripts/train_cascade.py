"""Train the cascade of boosted features that detectors are compared with, and write its model.

    pip install '.[sim,cascade]' && python scripts/train_cascade.py

It renders the first scenes of the suite `training`, unless the cache has them, and trains stage
after stage: each on rocks, and on windows of free ground that all stages before let pass. The
score that the last stage asks for is the one with the best mean IoU on the ``tune_*`` scenes of
the standard suite. The ``report_*`` scenes are never read. The same seed gives the same model.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import AdaBoostClassifier
from sklearn.tree import DecisionTreeClassifier

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import BadFrame
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.evaluation.figures import MIN_ROCK_PIXELS, score
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import FREE, ROCK
from rover_obstacle_detection.evaluation.methods import cascade
from rover_obstacle_detection.evaluation.methods.cascade import (
    GRADIENT,
    GREY,
    PATTERNS,
    WHOLE,
    WINDOW,
    Cascade,
    Feature,
    Stage,
    Windows,
    all_windows,
    covered,
    overlaps,
)
from rover_obstacle_detection.evaluation.methods.method import as_mask
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics
from rover_obstacle_detection.offline.output_file import check_output_file
from rover_obstacle_detection.simulation.cache import cache_folder, simulated_bag
from rover_obstacle_detection.simulation.suite import load_suite

MODEL = Path(cascade.__file__).with_name(cascade.MODEL_FILE)
SCENES = 24
# Stumps of each stage, and the share of the windows on rocks that each stage lets pass.
STUMPS = (8, 16, 32, 64, 128, 200)
PASSING_SHARE = 0.95
# Random features to choose from, and how many of them each stump tries.
FEATURES = 2500
FEATURES_PER_STUMP = 250
# Most windows of an image to train a stage on.
ROCK_WINDOWS = 200
GROUND_WINDOWS = 400
# A window is on a rock if their boxes overlap at least this much (IoU), and on free ground if at
# least this share of its box is.
MIN_OVERLAP = 0.6
MIN_FREE_SHARE = 0.7

Choice = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class View:
    """The left image of a labelled frame.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    frame : LabelledFrame
    """

    grey: NDArray[np.uint8]
    frame: LabelledFrame

    def rock_boxes(self) -> NDArray[np.float64]:
        """Boxes of the rocks that are large enough to count: column, row, width, height."""
        rocks = np.where(self.frame.labels == ROCK, self.frame.instances, 0)
        numbers, pixels = np.unique(rocks[rocks > 0], return_counts=True)
        boxes = [
            cv2.boundingRect((rocks == number).astype(np.uint8))
            for number in numbers[pixels >= MIN_ROCK_PIXELS]
        ]
        return np.array(boxes, np.float64).reshape(-1, 4)

    def rock_and_ground(self, windows: Windows) -> tuple[Choice, Choice]:
        """Mark the windows that are on a rock, and those on free ground."""
        overlap = overlaps(windows.boxes, self.rock_boxes()).max(axis=1, initial=0)
        sums = cv2.integral((self.frame.labels == FREE).astype(np.uint8))
        low = np.rint(windows.boxes[:, :2]).astype(int)
        high = np.rint(windows.boxes[:, :2] + windows.boxes[:, 2:]).astype(int)
        (left, top), (right, bottom) = (
            np.clip(corners, 0, np.array(self.grey.shape[::-1])).T for corners in (low, high)
        )
        free = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
        is_free = free >= MIN_FREE_SHARE * np.maximum((bottom - top) * (right - left), 1)
        return overlap >= MIN_OVERLAP, is_free & (overlap < MIN_OVERLAP / 2)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, choose the last score, write."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--seed', type=int, default=0, help='default: %(default)s')
    parser.add_argument(
        '--scenes', type=int, default=SCENES, metavar='N', help='default: %(default)s'
    )
    parser.add_argument(
        '--output', type=Path, default=MODEL, help="file to write (default: the package's)"
    )
    options = parser.parse_args(arguments)
    if options.scenes < 1:
        parser.error(f'--scenes is {options.scenes}: expected at least 1')
    try:
        check_output_file(options.output, force=True)
        trained = train(views('training', '', options.scenes), options.seed)
        chosen, mean_iou = with_best_score(trained, views('standard', 'tune_'))
        options.output.write_text(chosen.to_json(), encoding='utf-8')
    except (ObstacleDetectionError, OSError) as error:
        sys.exit(f'error: {error}')
    print(f'written: {options.output}, {options.output.stat().st_size} bytes')
    print(f'mean IoU, tuning scenes: {mean_iou:.3f}')


def views(suite: str, prefix: str, count: int | None = None) -> list[View]:
    """Left images of the first scenes of a suite whose names begin with a prefix."""
    scenes = [scene for scene in load_suite(suite) if scene.name.startswith(prefix)]
    return [
        view
        for scene in scenes[:count]
        for view in views_of_bag(simulated_bag(scene, cache_folder()))
    ]


def views_of_bag(path: Path) -> Iterator[View]:
    """Left images of a labelled bag."""
    print(f'reading {path.name}', file=sys.stderr)
    with open_bag(path) as bag:
        frames, _ = labelled_frames(bag, find_truth_topics(bag), BagOptions())
        for frame in frames:
            if not isinstance(frame, BadFrame):
                grey, _ = grey_pair(frame.left, frame.right, frame.camera)
                yield View(grey, frame)


def train(
    views: Sequence[View],
    seed: int,
    stumps: Sequence[int] = STUMPS,
    features: int = FEATURES,
) -> Cascade:
    """Train stage after stage on what those before let pass."""
    generator = np.random.default_rng(seed)
    pool = random_features(features, generator)
    trained = Cascade([])
    for count in stumps:
        windows, is_rock = samples(views, trained, generator)
        if is_rock.all():
            # No free ground gets past the stages so far.
            break
        everywhere = np.arange(len(is_rock))
        values = np.empty((len(is_rock), len(pool)), np.float32)
        for column, feature in enumerate(pool):
            values[:, column] = windows.values(feature, everywhere)
        print(
            f'stage of {count} stumps: {is_rock.sum()} windows on rocks, '
            f'{(~is_rock).sum()} on free ground',
            file=sys.stderr,
        )
        stage = boosted_stage(values, is_rock, pool, count, seed)
        trained = Cascade([*trained.stages, stage])
    return trained


def random_features(count: int, generator: np.random.Generator) -> list[Feature]:
    """Draw different features that lie in the window; whole cells only of the gradient."""
    drawn: dict[Feature, None] = {}
    while len(drawn) < count:
        pattern = int(generator.integers(len(PATTERNS)))
        channel = GRADIENT if pattern == WHOLE else int(generator.choice((GREY, GRADIENT)))
        cells = PATTERNS[pattern].shape
        size = [
            int(generator.integers(1, window // cell, endpoint=True))
            for window, cell in zip(WINDOW, cells, strict=True)
        ]
        corner = [
            int(generator.integers(window - cell * each, endpoint=True))
            for window, cell, each in zip(WINDOW, cells, size, strict=True)
        ]
        drawn[Feature(channel, pattern, *corner, *size)] = None
    return list(drawn)


def samples(
    views: Sequence[View], trained: Cascade, generator: np.random.Generator
) -> tuple[Windows, Choice]:
    """Draw windows that get past all stages; also return which of them are on rocks."""
    parts, is_rock = [], []
    for view in views:
        levels = list(all_windows(view.grey))
        passed = [trained.survivors(windows)[0] for windows in levels]
        kinds = [view.rock_and_ground(windows) for windows in levels]
        for kind, most in enumerate((ROCK_WINDOWS, GROUND_WINDOWS)):
            found = [numbers[kinds[level][kind][numbers]] for level, numbers in enumerate(passed)]
            ends = np.cumsum([len(numbers) for numbers in found])
            is_drawn = generator.permutation(ends[-1]) < most
            is_rock.append(np.full(min(ends[-1], most), kind == 0))
            parts += [
                cut_out(windows, numbers[drawn])
                for windows, numbers, drawn in zip(
                    levels, found, np.split(is_drawn, ends[:-1]), strict=True
                )
            ]
    return joined(parts), np.concatenate(is_rock)


def cut_out(windows: Windows, numbers: NDArray[np.intp]) -> Windows:
    """Give windows integral images of their own, to keep a few of each image."""
    rows = np.arange(WINDOW[0] + 1)[:, np.newaxis] * windows.row_length
    places = (rows + np.arange(WINDOW[1] + 1)).ravel()
    return Windows(
        [each[windows.starts[numbers, np.newaxis] + places].ravel() for each in windows.channels],
        WINDOW[1] + 1,
        np.arange(len(numbers)) * places.size,
        windows.deviation[numbers],
        windows.boxes[numbers],
    )


def joined(parts: Sequence[Windows]) -> Windows:
    """Put windows that were cut out together."""
    boxes = np.concatenate([part.boxes for part in parts])
    return Windows(
        [np.concatenate(each) for each in zip(*(part.channels for part in parts), strict=True)],
        WINDOW[1] + 1,
        np.arange(len(boxes)) * (WINDOW[0] + 1) * (WINDOW[1] + 1),
        np.concatenate([part.deviation for part in parts]),
        boxes,
    )


def boosted_stage(
    values: NDArray[np.float32],
    is_rock: Choice,
    pool: Sequence[Feature],
    count: int,
    seed: int,
) -> Stage:
    """Boost stumps (AdaBoost) that weigh rocks and free ground the same."""
    stump = DecisionTreeClassifier(max_depth=1, max_features=min(FEATURES_PER_STUMP, len(pool)))
    boosted = AdaBoostClassifier(stump, n_estimators=count, random_state=seed)
    boosted.fit(values, is_rock, np.where(is_rock, 0.5 / is_rock.sum(), 0.5 / (~is_rock).sum()))
    features, thresholds, weights, scores = [], [], [], np.zeros(len(values))
    for tree, weight in zip(boosted.estimators_, boosted.estimator_weights_, strict=False):
        below, above = (tree.classes_[leaf] for leaf in tree.tree_.value[1:, 0].argmax(axis=1))
        if below == above:
            continue
        column = int(tree.tree_.feature[0])
        features.append(pool[column])
        thresholds.append(round(float(tree.tree_.threshold[0]), 5))
        weights.append(round(float(weight if above else -weight), 5))
        scores += np.where(values[:, column] > thresholds[-1], weights[-1], -weights[-1])
    passing = float(np.quantile(scores[is_rock], 1 - PASSING_SHARE))
    return Stage(features, thresholds, weights, round(passing - 1e-4, 4))


def with_best_score(trained: Cascade, views: Sequence[View]) -> tuple[Cascade, float]:
    """Choose the score of the last stage by the mean IoU; also return this."""
    found = [(view, *trained.detect(view.grey)) for view in views]
    last = trained.stages[-1]
    tried = np.quantile(np.concatenate([scores for *_, scores in found]), np.arange(0, 1, 0.02))
    ious = [
        statistics.fmean(iou for each in found if (iou := iou_at(*each, least)) is not None)
        for least in tried
    ]
    best = int(np.argmax(ious))
    stage = replace(last, min_score=round(float(tried[best]), 4))
    return Cascade([*trained.stages[:-1], stage]), ious[best]


def iou_at(
    view: View, boxes: NDArray[np.float64], scores: NDArray[np.float64], least: float
) -> float | None:
    """IoU of a view if only boxes with this score count; None without obstacles."""
    mask = as_mask(covered(boxes[scores >= least], view.grey.shape))
    figures = score(mask, view.frame.labels, view.frame.instances)
    return figures.iou if figures.obstacle_pixels else None


if __name__ == '__main__':
    main()
