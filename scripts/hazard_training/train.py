"""The training of the network that judges the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from training_loop import minimise

from hazard_training.examples import MapExample
from hazard_training.network import HazardNet, cell_logits
from rover_obstacle_detection.detection.terrain.cell_features import FEATURES
from rover_obstacle_detection.detection.terrain.hazard_model import CLASSES
from rover_obstacle_detection.errors import BagError

CROP_CELLS = 128
"""Side of a crop, a multiple of sixteen: the network reduces the resolution as much."""

_BATCH = 10
_IOU_WEIGHT = 0.5
_SPECK_PX = 100
"""Pixels of a crop below which a hazard counts less."""

_MIN_PIXELS, _MIN_CELLS = 200, 8
"""Smaller maps are left out."""

_AT_A_HAZARD = 0.6
_MIRRORED = 0.5
"""Shares of the crops."""

_PLACES = 7
"""One cell in so many may be the middle of a crop."""

_FREE = CLASSES.index('free')
_SEEN, _NOISE = FEATURES.index('seen'), FEATURES.index('noise over the step')
_TO_THE_LEFT = FEATURES.index('difference to the left over the slope')
_RISE_RIGHT = FEATURES.index('rise to the right over the slope')
_NOISES = tuple(number for number, name in enumerate(FEATURES) if name.startswith('noise of'))


class Crops(NamedTuple):
    """What one step of the training learns from.

    Parameters
    ----------
    features : Tensor of float32, shape (n, features, rows, columns)
    pixels : Tensor of float32, shape (n, classes, rows, columns)
        Number of pixels of each class in each cell.
    """

    features: torch.Tensor
    pixels: torch.Tensor


class Sampler:
    """Draws crops: of large maps and of those with hazards more often.

    Parameters
    ----------
    examples : sequence of MapExample
    generator : Generator
    """

    def __init__(self, examples: Sequence[MapExample], generator: np.random.Generator) -> None:
        self._generator = generator
        self._maps = [
            _padded(each)
            for each in examples
            if each.pixels.sum(dtype=np.float64) >= _MIN_PIXELS
            and min(each.pixels.shape[1:]) >= _MIN_CELLS
        ]
        if not self._maps:
            msg = f'no map has {_MIN_PIXELS} labelled pixels: expected views of the ground'
            raise BagError(msg)
        free, hazards = (
            [np.argwhere(chosen)[::_PLACES] for chosen in kind]
            for kind in zip(
                *(
                    (each.pixels[_FREE] > 0, np.delete(each.pixels, _FREE, 0).any(axis=0))
                    for each in self._maps
                ),
                strict=True,
            )
        )
        self._free, self._hazards = free, hazards
        size = np.sqrt([each.pixels.sum(dtype=np.float64) for each in self._maps])
        weight = size * np.array([2.0 if len(places) else 1.0 for places in hazards])
        self._share = weight / weight.sum()

    def crops(self) -> Crops:
        """Draw the crops of one step."""
        drawn = [self._crop() for _ in range(_BATCH)]
        features, pixels = (torch.from_numpy(np.stack(each)) for each in zip(*drawn, strict=True))
        return Crops(features, pixels)

    def _crop(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        generator = self._generator
        number = int(generator.choice(len(self._maps), p=self._share))
        hazards, free = self._hazards[number], self._free[number]
        at_hazard = len(hazards) and (not len(free) or generator.random() < _AT_A_HAZARD)
        places = hazards if at_hazard else free
        row, column = places[generator.integers(len(places))]
        example = self._maps[number]
        rows, columns = example.pixels.shape[1:]
        reach = CROP_CELLS // 3
        corner = np.array([row, column]) - CROP_CELLS // 2
        corner += generator.integers(-reach, reach + 1, 2)
        top, left = np.clip(corner, 0, [rows - CROP_CELLS, columns - CROP_CELLS])
        window = np.s_[:, top : top + CROP_CELLS, left : left + CROP_CELLS]
        features = example.features[window].astype(np.float32)
        pixels = example.pixels[window].astype(np.float32)
        if generator.random() < _MIRRORED:
            features, pixels = mirrored(features), pixels[:, :, ::-1].copy()
        vary_noise(features, generator)
        return features, pixels


def mirrored(features: NDArray[np.float32]) -> NDArray[np.float32]:
    """Exchange left and right."""
    features = features[:, :, ::-1].copy()
    features[_RISE_RIGHT] *= -1
    # The difference to the left becomes that of the next cell.
    features[_TO_THE_LEFT] = -np.roll(features[_TO_THE_LEFT], 1, axis=1)
    return features


def vary_noise(features: NDArray[np.float32], generator: np.random.Generator) -> None:
    """Vary the claimed noise, in place."""
    features[_NOISE] += generator.normal(0, 0.1) * features[_SEEN]
    for number in _NOISES:
        features[number] *= math.exp(generator.normal(0, 0.15))


def train(
    examples: Sequence[MapExample], steps: int, minutes: float = math.inf, seed: int = 0
) -> HazardNet:
    """Train a network from random weights.

    Parameters
    ----------
    examples : sequence of MapExample
    steps : int
    minutes : float
        The training ends after this time if the steps take longer.
    seed : int
        The same seed gives the same weights on the same machine, unless time runs out.
    """
    torch.manual_seed(seed)
    sampler = Sampler(examples, np.random.default_rng(seed))
    return minimise(
        HazardNet(),
        sampler.crops,
        lambda net, crops: loss_of(cell_logits(net, crops.features), crops.pixels),
        steps,
        minutes,
    )


def loss_of(logits: torch.Tensor, pixels: torch.Tensor) -> torch.Tensor:
    """Cross-entropy of the pixels, plus a share of one minus the mean soft IoU of the crops."""
    log_share = torch.log_softmax(logits, 1)
    total = pixels.sum((1, 2, 3)).clamp(min=_SPECK_PX / 2)
    entropy = -(pixels * log_share).sum((1, 2, 3)) / total
    hazard = 1 - log_share[:, _FREE].exp()
    free = pixels[:, _FREE]
    true = pixels.sum(1) - free
    intersection = (hazard * true).sum((1, 2))
    union = (true + hazard * free).sum((1, 2))
    iou = (intersection + _SPECK_PX) / (union + _SPECK_PX)
    return (entropy + _IOU_WEIGHT * (1 - iou)).mean()


def _padded(example: MapExample) -> MapExample:
    """Make a map at least as large as a crop."""
    rows, columns = example.pixels.shape[1:]
    missing = (0, 0), (0, max(0, CROP_CELLS - rows)), (0, max(0, CROP_CELLS - columns))
    return MapExample(np.pad(example.features, missing), np.pad(example.pixels, missing))
