"""Train the network that outlines obstacles, and write it into the package.

    pip install '.[sim,train]'
    python scripts/train_outlines.py                                    # rendering, then training
    python scripts/train_outlines.py --cached-only --minutes 60         # no rendering
    python scripts/train_outlines.py --bags BAG... --output model.onnx  # on your own recordings
    python scripts/train_outlines.py --start MODEL --teacher scripts/outline_training/teacher.onnx

One command renders, trains, exports and checks the network:

1. It renders the suites `training` and `training_wide`, unless the cache has them, and computes
   the features of each frame as the detector does.
2. It trains the network, from random weights or from those of `--start`.
3. It exports the network, compares the file with PyTorch, and only then moves it into place.
4. It prints the IoU of rocks on scenes that it was not trained on: a tenth of both suites, and the
   ``tune_*`` scenes of the standard suite. It never reads the ``report_*`` scenes.

The teacher in ``scripts/outline_training`` has two branches, each like the network that ships, and
takes twice as long. The shipped network began as one of them and learned from both. From random
weights, a quarter of the scenes and an hour are not enough: compare a new network with
``scripts/update_evaluation.py`` before you replace the old one.

On a machine with other load, set ``OMP_NUM_THREADS=1``: threads that wait for each other slow the
training several times.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatch
from itertools import chain
from pathlib import Path

from outline_training.examples import Example, examples_of_bags
from outline_training.export import read_network, write_model
from outline_training.score import mean_iou
from outline_training.train import train
from training_bags import bags_of_suite

from rover_obstacle_detection.detection.rocks import outline_model
from rover_obstacle_detection.detection.rocks.outline_model import OutlineModel
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.offline.output_file import check_output_file

MODEL = Path(outline_model.__file__).with_name(outline_model.MODEL_FILE)
STEPS = 20_000
SUITES = ('training', 'training_wide')
HELD_OUT_SCENES = '*_*0_*_*'
HELD_OUT_BAG = 10
"""Of the given bags, every tenth is held out."""


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
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        '--cached-only', action='store_true', help='use only scenes that are already rendered'
    )
    source.add_argument(
        '--bags',
        type=Path,
        nargs='+',
        metavar='BAG',
        help='train on these labelled bags instead of the suites; every tenth is held out',
    )
    parser.add_argument(
        '--teacher',
        type=Path,
        metavar='MODEL',
        help='ONNX file of another network, to learn from its output besides the labels',
    )
    parser.add_argument(
        '--start',
        type=Path,
        metavar='MODEL',
        help='ONNX file of this script to improve (default: random weights)',
    )
    parser.add_argument(
        '--output', type=Path, default=MODEL, help="ONNX file to write (default: the package's)"
    )
    options = parser.parse_args(arguments)
    if options.steps < 1:
        parser.error(f'--steps is {options.steps}: expected at least 1')
    if not options.minutes > 0:
        parser.error(f'--minutes is {options.minutes:g}: expected more than 0')
    try:
        check_output_file(options.output, force=True)
        start = read_network(options.start) if options.start else None
        teacher = OutlineModel(options.teacher.read_bytes()) if options.teacher else None
        training, unseen = (
            given_bags(options.bags) if options.bags else suites(cached_only=options.cached_only)
        )
        if not training:
            sys.exit('error: nothing to train on')
        net = train(training, options.steps, options.minutes, teacher, start)
        model = write_model(net, options.output)
    except (ObstacleDetectionError, OSError) as error:
        sys.exit(f'error: {error}')
    print(f'written: {options.output}, {options.output.stat().st_size} bytes')
    for name, examples in unseen.items():
        print(
            f'mean IoU of rocks, {name}, {len(examples)} frames: {mean_iou(model, examples):.3f}'
        )


def suites(*, cached_only: bool = False) -> tuple[list[Example], dict[str, list[Example]]]:
    """Examples of the suites: to train on, and by name to report on."""

    def bags(suite: str, is_chosen: Callable[[str], bool]) -> Iterator[Path]:
        return bags_of_suite(suite, is_chosen, cached_only=cached_only)

    def is_held_out(scene: str) -> bool:
        return fnmatch(scene, HELD_OUT_SCENES)

    training = chain.from_iterable(
        bags(suite, lambda scene: not is_held_out(scene)) for suite in SUITES
    )
    return examples_of_bags(training), {
        f'held-out scenes of {suite}': examples_of_bags(bags(suite, is_held_out))
        for suite in SUITES
    } | {
        'tuning scenes': examples_of_bags(
            bags('standard', lambda scene: scene.startswith('tune_'))
        )
    }


def given_bags(paths: Sequence[Path]) -> tuple[list[Example], dict[str, list[Example]]]:
    """Examples of bags, likewise; fewer than ten bags are all trained on."""
    held_out = paths[HELD_OUT_BAG - 1 :: HELD_OUT_BAG]
    training = [path for path in paths if path not in held_out]
    unseen = {'held-out bags': examples_of_bags(held_out)} if held_out else {}
    return examples_of_bags(training), unseen


if __name__ == '__main__':
    main()
