"""Train the network that judges the ground, and write it into the package.

    pip install '.[sim,train]'
    python scripts/train_hazards.py                              # rendering, then training
    python scripts/train_hazards.py --cached-only --minutes 20   # no rendering
    python scripts/train_hazards.py --bags BAG... --drawn 0 --output model.onnx

One command renders, draws, trains, exports and checks the network:

1. It renders the training scenes with edges or slopes, unless the cache has them, and measures
   each as the detector does: for the default limits, and for a rover with other limits.
2. It draws more ground, without rendering: exact geometry with errors as of matching.
3. It trains the network on every labelled pixel that is not on a rock.
4. It exports the network, compares the file with PyTorch, and only then moves it into place.
5. It prints the IoU of hazards on the scenes ``hazard_tune_*``, which it was not trained on.

The shipped network learned from 156 rendered scenes, those of ``training_wide`` and 37 of
``training``, and from 160 drawn grounds, for 13 minutes on two cores (``--cached-only --drawn 160
--minutes 13``). Compare a new network with ``scripts/update_evaluation.py`` before you replace
the old one.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from hazard_training.drawn_ground import drawn_examples
from hazard_training.examples import LABELS, MapExample, examples_of_bag
from hazard_training.export import write_model
from hazard_training.train import train
from training_bags import bags_of_suite

from rover_obstacle_detection.detection.terrain import hazard_model
from rover_obstacle_detection.detection.terrain.hazard_model import HazardModel
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.evaluation.labels import FREE
from rover_obstacle_detection.offline.output_file import check_output_file

Source = TypeVar('Source')

MODEL = Path(hazard_model.__file__).with_name(hazard_model.MODEL_FILE)
STEPS = 10_000
DRAWN = 300
SUITES = ('training_wide', 'training')
PLAIN_SHARE = 12
"""Of the scenes of `training` without slopes, craters and dunes, one in so many is taken."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, write, report."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument(
        '--steps', type=int, default=STEPS, help='training steps (default: %(default)s)'
    )
    parser.add_argument(
        '--minutes',
        type=float,
        default=math.inf,
        help='time of the training, if it ends before the steps (default: no limit)',
    )
    parser.add_argument(
        '--drawn',
        type=int,
        default=DRAWN,
        help='grounds to draw without rendering (default: %(default)s)',
    )
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        '--cached-only', action='store_true', help='use only scenes that are already rendered'
    )
    source.add_argument(
        '--bags',
        type=Path,
        nargs='+',
        metavar='BAG',
        help='train on these labelled bags instead of the suites',
    )
    parser.add_argument(
        '--output', type=Path, default=MODEL, help="ONNX file to write (default: the package's)"
    )
    options = parser.parse_args(arguments)
    if options.steps < 1:
        parser.error(f'--steps is {options.steps}: expected at least 1')
    if not options.minutes > 0:
        parser.error(f'--minutes is {options.minutes:g}: expected more than 0')
    if options.drawn < 0:
        parser.error(f'--drawn is {options.drawn}: expected at least 0')
    try:
        check_output_file(options.output, force=True)
        bags = options.bags or training_bags(cached_only=options.cached_only)
        examples = made(examples_of_bag, bags) + made(drawn_examples, range(options.drawn))
        if not examples:
            sys.exit('error: nothing to train on')
        model = write_model(train(examples, options.steps, options.minutes), options.output)
        print(f'written: {options.output}, {options.output.stat().st_size} bytes')
        if not options.bags:
            unseen = list(bags_of_suite('hazards', is_tuning, cached_only=options.cached_only))
            if not unseen:
                sys.exit()
            print(
                f'IoU of slopes and drops, {len(unseen)} scenes hazard_tune_*: '
                f'{iou(model, made(examples_of_bag, unseen)):.3f}'
            )
    except (ObstacleDetectionError, OSError) as error:
        sys.exit(f'error: {error}')


def made(
    make: Callable[[Source], list[MapExample]], sources: Iterable[Source]
) -> list[MapExample]:
    """Make the examples of all sources, in as many processes as there are cores."""
    # Threads of PyTorch do not survive a fork, and each process has one core.
    with ProcessPoolExecutor(
        mp_context=get_context('spawn'), initializer=cv2.setNumThreads, initargs=(1,)
    ) as pool:
        return list(chain.from_iterable(pool.map(make, sources)))


def is_tuning(scene: str) -> bool:
    """Whether parameters are chosen on a scene."""
    return scene.startswith('hazard_tune_')


def training_bags(*, cached_only: bool = False) -> list[Path]:
    """Choose rendered scenes to train on: those with edges or relief, and some others."""

    def is_chosen(scene: str) -> bool:
        _, number, _ = scene.split('_', 2)
        uneven = any(kind in scene for kind in ('slope', 'crater', 'dunes'))
        return not scene.startswith('train_') or uneven or int(number) % PLAIN_SHARE == 0

    return [
        bag for suite in SUITES for bag in bags_of_suite(suite, is_chosen, cached_only=cached_only)
    ]


def iou(model: HazardModel, examples: Sequence[MapExample]) -> float:
    """IoU of the pixels of slopes and drops; NaN without any."""
    free = LABELS.index(FREE)
    intersection = union = 0.0
    for each in examples:
        found = sum(model.probability(each.features.astype(np.float32))) > 0.5
        pixels = each.pixels.astype(np.float64)
        true = pixels.sum(axis=0) - pixels[free]
        intersection += float(true[found].sum())
        union += float(true.sum() + pixels[free][found].sum())
    return intersection / union if union else math.nan


if __name__ == '__main__':
    main()
