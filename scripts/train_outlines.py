"""Train the network that outlines obstacles, and write it into the package.

    pip install '.[sim,train]'
    python scripts/train_outlines.py                                    # rendering, then 3 hours
    python scripts/train_outlines.py --bags BAG... --output model.onnx  # on your own recordings

One command renders, trains, exports and checks the network:

1. It renders the suite `training`, unless the cache has it, and computes the features of each
   frame as the detector does.
2. It trains one branch from random weights, puts it beside its mirror image, and trains both.
3. It exports the network, compares the file with PyTorch, and only then moves it into place.
4. It prints the IoU of rocks on scenes that it was not trained on: thirty of the suite `training`,
   and the ``tune_*`` scenes of the standard suite. It never reads the ``report_*`` scenes.

A run from random weights does not reproduce the shipped file, which was trained in several runs.
Compare both with ``scripts/update_evaluation.py``.

On a machine with other load, set ``OMP_NUM_THREADS=1``: threads that wait for each other slow the
training several times.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

from outline_training.examples import Example, bags_of_suite, examples_of_bags
from outline_training.export import write_model
from outline_training.score import mean_iou
from outline_training.train import train_from_random_weights

from rover_obstacle_detection.detection.rocks import outline_model
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.offline.output_file import check_output_file

MODEL = Path(outline_model.__file__).with_name(outline_model.MODEL_FILE)
STEPS = 30_000
HELD_OUT_SCENES = 'train_21[5-7]*'
HELD_OUT_BAG = 10
"""Of the given bags, every tenth is held out."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, write, report."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument(
        '--steps', type=int, default=STEPS, help='training steps (default: %(default)s)'
    )
    parser.add_argument(
        '--bags',
        type=Path,
        nargs='+',
        metavar='BAG',
        help='train on these labelled bags instead of the suite; every tenth is held out',
    )
    parser.add_argument(
        '--output', type=Path, default=MODEL, help="ONNX file to write (default: the package's)"
    )
    options = parser.parse_args(arguments)
    if options.steps < 2:
        parser.error(f'--steps is {options.steps}: expected at least 2, one for each phase')
    try:
        check_output_file(options.output, force=True)
        training, unseen = given_bags(options.bags) if options.bags else suites()
        net = train_from_random_weights(training, options.steps)
        model = write_model(net, options.output)
    except ObstacleDetectionError as error:
        sys.exit(f'error: {error}')
    print(f'written: {options.output}, {options.output.stat().st_size} bytes')
    for name, examples in unseen.items():
        print(
            f'mean IoU of rocks, {name}, {len(examples)} frames: {mean_iou(model, examples):.3f}'
        )


def suites() -> tuple[list[Example], dict[str, list[Example]]]:
    """Examples of the suites: to train on, and by name to report on."""
    training = bags_of_suite('training', lambda scene: not fnmatch(scene, HELD_OUT_SCENES))
    held_out = bags_of_suite('training', lambda scene: fnmatch(scene, HELD_OUT_SCENES))
    tuning = bags_of_suite('standard', lambda scene: scene.startswith('tune_'))
    return examples_of_bags(training), {
        'held-out scenes': examples_of_bags(held_out),
        'tuning scenes': examples_of_bags(tuning),
    }


def given_bags(paths: Sequence[Path]) -> tuple[list[Example], dict[str, list[Example]]]:
    """Examples of bags, likewise; fewer than ten bags are all trained on."""
    held_out = paths[HELD_OUT_BAG - 1 :: HELD_OUT_BAG]
    training = [path for path in paths if path not in held_out]
    unseen = {'held-out bags': examples_of_bags(held_out)} if held_out else {}
    return examples_of_bags(training), unseen


if __name__ == '__main__':
    main()
