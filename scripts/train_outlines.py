"""Train the filter that draws the outlines of obstacles, and write it into the package.

    pip install '.[sim,train]'
    python scripts/train_outlines.py

Trains on the scenes of the suite `training` (rendered if need be) but some that it holds out, and
reports on those and on the scenes ``tune_*`` of the standard suite; those named ``report_*`` it
never reads. Needs PyTorch, the package needs only the file that comes out of it. On two cores that
takes an hour or more, once the scenes are there. The weights that are shipped came of a dozen such
runs of one branch, each begun from the last one's weights as scenes, variation, layers and planes
were added: channels with small random weights, corrections and planes with none. Then two of them
were put side by side by hand, one of them mirrored, and trained on together for an hour, and for
an hour and a half more with shaded ground. A run from the beginning gives others.
"""

from __future__ import annotations

import argparse
import copy
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from outline_crops import CROP, STANDING, Example, crop
from outline_network import Corrected, Folded, OutlineNet
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.detection.rocks import outline_model
from rover_obstacle_detection.detection.rocks.outline_features import (
    PLANES,
    outline_planes,
)
from rover_obstacle_detection.detection.stereo.ground_matching import match_against_ground
from rover_obstacle_detection.detection.terrain.hazards import standing_parts
from rover_obstacle_detection.detection.terrain.survey import survey
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import FREE, NOT_COUNTED, ROCK
from rover_obstacle_detection.offline.evaluate import BagOptions, labelled_frames
from rover_obstacle_detection.offline.labelled_bag import find_truth_topics
from rover_obstacle_detection.simulation.cache import cache_folder, simulated_bag
from rover_obstacle_detection.simulation.suite import load_suite

MODEL = Path(outline_model.__file__).with_name(outline_model.MODEL_FILE)
BATCH = 10
HELD_OUT = 'train_21[5-7]*'
RATE = 3e-3
PLACES = 40
IOU_WEIGHT = 0.5
# Pixels, of a crop's 25,600.
SPECK = 50


def main() -> None:
    """Train, report, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--steps', type=int, default=30_000)
    parser.add_argument(
        '--start', type=Path, nargs='+', help='weights to begin from (.pt); the mean of several'
    )
    parser.add_argument('--weights', type=Path, help='where to keep the weights as well (.pt)')
    parser.add_argument('--output', type=Path, default=MODEL)
    arguments = parser.parse_args()
    torch.manual_seed(0)
    examples = {
        name: [example_of(frame) for frame in frames_of(suite, chosen)]
        for name, suite, chosen in (
            ('training', 'training', lambda scene: not fnmatch(scene, HELD_OUT)),
            ('held-out', 'training', lambda scene: fnmatch(scene, HELD_OUT)),
            ('tuning', 'standard', lambda scene: scene.startswith('tune_')),
        )
    }
    net = OutlineNet()
    if arguments.start:
        begin_from(net, arguments.start)
    net = train(net, examples['training'], arguments.steps)
    for name in ('held-out', 'tuning'):
        print(f'mean IoU of rocks on the {name} scenes: {mean_iou(net, examples[name]):.3f}')
    if arguments.weights:
        torch.save(net.state_dict(), arguments.weights)
    export(net, arguments.output)
    print(f'written: {arguments.output}, {arguments.output.stat().st_size} bytes')


def begin_from(net: OutlineNet, paths: Sequence[Path]) -> None:
    """Take the mean of weights; of a network without corrections as well, which are then none."""
    every = []
    for path in paths:
        single = copy.deepcopy(net)
        missing, unexpected = single.load_state_dict(torch.load(path), strict=False)
        if unexpected or not all('.correct.' in name for name in missing):
            sys.exit(f'{path}: not of this network: missing {missing}, not known {unexpected}')
        every.append(single.state_dict())
    mean = {name: sum(each[name] for each in every) / len(every) for name in every[0]}
    net.load_state_dict(mean)


def frames_of(suite: str, chosen: Callable[[str], bool]) -> Iterator[LabelledFrame]:
    """Labelled frames of the scenes of a suite whose names are chosen."""
    for scene in load_suite(suite):
        if chosen(scene.name):
            print(f'scene {scene.name}', file=sys.stderr)
            with open_bag(simulated_bag(scene, cache_folder())) as bag:
                frames, _ = labelled_frames(bag, find_truth_topics(bag), BagOptions())
                yield from (frame for frame in frames if isinstance(frame, LabelledFrame))


def example_of(frame: LabelledFrame) -> Example:
    """Make a frame's planes as the detector makes them."""
    config = DetectorConfig()
    pair = grey_pair(frame.left, frame.right, frame.camera)
    stereo = match_against_ground(pair, frame.camera, config, None, None, lambda stage: None)
    terrain = survey(
        stereo.disparity, stereo.noise_px, stereo.expected, frame.camera, stereo.ground, config
    )
    standing = standing_parts(terrain, config)
    planes = outline_planes(stereo, terrain, standing, frame.camera, config)
    rock = frame.labels == ROCK
    # Slopes and drops are found by other means: there the filter may say what it likes.
    counted = rock | (frame.labels == FREE)
    assert NOT_COUNTED != FREE
    places = even_places(rock | (planes[STANDING] > 0))
    return Example(
        torch.from_numpy(planes.astype(np.float16)),
        torch.from_numpy(rock),
        torch.from_numpy(counted),
        places,
    )


def even_places(where: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Draw some pixels of each connected part, as many of a small one as of a large one."""
    _, parts = cv2.connectedComponents(where.astype(np.uint8), connectivity=8)
    generator = np.random.default_rng(0)
    pixels = generator.permutation(np.flatnonzero(parts))
    order = np.argsort(parts.ravel()[pixels], kind='stable')
    pixels = pixels[order]
    _, first, count = np.unique(parts.ravel()[pixels], return_index=True, return_counts=True)
    rank = np.arange(len(pixels)) - np.repeat(first, count)
    return np.stack(np.unravel_index(pixels[rank < PLACES], parts.shape), axis=1)


def train(net: OutlineNet, examples: Sequence[Example], steps: int) -> OutlineNet:
    """Minimise cross-entropy and one minus the mean of the soft IoU of random crops.

    What comes out is the running mean of the weights over the last thousand steps or so.
    """
    mean = AveragedModel(net, multi_avg_fn=get_ema_multi_avg_fn(0.999))
    generator = np.random.default_rng(0)
    optimizer = torch.optim.AdamW(net.parameters(), lr=RATE, weight_decay=1e-2)
    net.to(memory_format=torch.channels_last)
    for number in range(steps):
        rate = RATE * min(1, number / 100) * 0.5 * (1 + math.cos(math.pi * number / steps))
        for group in optimizer.param_groups:
            group['lr'] = rate + 1e-5
        crops = [
            crop(examples[generator.integers(len(examples))], generator) for _ in range(BATCH)
        ]
        planes, rock, counted = (torch.stack(each) for each in zip(*crops, strict=True))
        with torch.autocast('cpu', dtype=torch.bfloat16):
            logit = full_resolution(net, planes.to(memory_format=torch.channels_last))
        logit = logit.float()
        entropy = functional.binary_cross_entropy_with_logits(logit, rock, reduction='none')
        iou = soft_iou(torch.sigmoid(logit) * counted, rock * counted).mean()
        loss = (entropy * counted).sum() / counted.sum() + IOU_WEIGHT * (1 - iou)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        mean.update_parameters(net)
        if number % 500 == 499:
            print(f'step {number + 1}: loss {float(loss.detach()):.3f}', file=sys.stderr)
    averaged = mean.module
    assert isinstance(averaged, OutlineNet)
    return averaged


def soft_iou(found: torch.Tensor, rock: torch.Tensor) -> torch.Tensor:
    """Return the IoU of each crop: a far rock counts as much as a near one, but for specks."""
    both = (found * rock).sum((1, 2))
    either = (found + rock).sum((1, 2)) - both
    return (both + SPECK) / (either + SPECK)


def full_resolution(net: OutlineNet, planes: torch.Tensor) -> torch.Tensor:
    """Logits of each pixel, shape (n, height, width)."""
    return functional.pixel_shuffle(net(planes), 2)[:, 0]


def mean_iou(net: OutlineNet, examples: Sequence[Example]) -> float:
    """Mean over the frames with rocks of the IoU of their pixels."""
    values = []
    with torch.no_grad():
        for example in examples:
            height, width = example.rock.shape
            planes = functional.pad(
                example.planes.float()[None], (0, -width % 8, 0, -height % 8), mode='replicate'
            )
            found = (full_resolution(net, planes)[0, :height, :width] > 0) & example.counted
            either = int((found | example.rock).sum())
            if example.rock.any():
                values.append(int((found & example.rock).sum()) / either)
    return float(np.mean(values))


def export(net: OutlineNet, path: Path) -> None:
    """Write the network for OpenCV, for images of any size that is a multiple of eight."""
    net = copy.deepcopy(net).eval().to(memory_format=torch.contiguous_format)
    for module in list(net.modules()):
        for name, child in module.named_children():
            if isinstance(child, Corrected):
                setattr(module, name, Folded(child))
    torch.onnx.export(
        net,
        (torch.zeros(1, len(PLANES), CROP, CROP),),
        str(path),
        input_names=['planes'],
        output_names=['logits'],
        dynamic_axes={'planes': {2: 'height', 3: 'width'}, 'logits': {2: 'h', 3: 'w'}},
        opset_version=13,
        dynamo=False,
    )


if __name__ == '__main__':
    main()
