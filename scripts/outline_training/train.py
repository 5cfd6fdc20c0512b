"""The training of the network."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch.nn import functional
from training_loop import PEAK_RATE, minimise

from outline_training.crops import random_crop
from outline_training.examples import Example
from outline_training.network import SIDE_PX, OutlineNet
from rover_obstacle_detection.detection.rocks.outline_model import OutlineModel

_BATCH = 10
_LATER_PEAK_RATE = 5e-4

_TEACHER_WEIGHT = 0.7
_IOU_WEIGHT = 0.5
_SPECK_PX = 50
"""Pixels, of a crop's 25,600, below which a rock counts less."""


class Batch(NamedTuple):
    """What one step of the training learns from.

    Parameters
    ----------
    features : Tensor of float32, shape (n, features, height, width)
    rock, counted : Tensor of float32, shape (n, height, width)
        1 on rocks; and 1 where the labels count.
    taught : Tensor of float32, shape (n, height, width), or None
        The teacher's probability of rock.
    """

    features: torch.Tensor
    rock: torch.Tensor
    counted: torch.Tensor
    taught: torch.Tensor | None = None


def train(
    examples: Sequence[Example],
    steps: int,
    minutes: float = math.inf,
    teacher: OutlineModel | None = None,
    start: OutlineNet | None = None,
    seed: int = 0,
) -> OutlineNet:
    """Minimise the loss of random crops by AdamW, and return the running mean of the weights.

    Parameters
    ----------
    examples : sequence of Example
    steps : int
    minutes : float
        The training ends after this time if the steps take longer. The learning rate falls in
        time for whichever comes first.
    teacher : OutlineModel, optional
        A model to learn from, besides the labels. It sees the same varied crops (Beyer et al.
        2022).
    start : OutlineNet, optional
        Network whose weights are improved, at a lower learning rate; random ones by default.
    seed : int
        The same seed gives the same weights on the same machine, unless time runs out.
    """
    torch.manual_seed(seed)
    generator = np.random.default_rng(seed)
    return minimise(
        start or OutlineNet(),
        lambda: random_batch(examples, generator, teacher),
        lambda net, batch: loss_of(pixel_logits(net, batch.features), batch),
        steps,
        minutes,
        _LATER_PEAK_RATE if start else PEAK_RATE,
    )


def random_batch(
    examples: Sequence[Example],
    generator: np.random.Generator,
    teacher: OutlineModel | None = None,
) -> Batch:
    """Stack random crops of random examples, and ask the teacher about them."""
    crops = [
        random_crop(examples[generator.integers(len(examples))], generator) for _ in range(_BATCH)
    ]
    features, rock, counted = (torch.stack(each) for each in zip(*crops, strict=True))
    if not teacher:
        return Batch(features, rock, counted)
    taught = [torch.from_numpy(teacher.probability(each.numpy())) for each in features]
    return Batch(features, rock, counted, torch.stack(taught))


def loss_of(logits: torch.Tensor, batch: Batch) -> torch.Tensor:
    """Cross-entropy, plus a share of one minus the mean soft IoU of the counted pixels.

    Where the labels count, the target is between them and the teacher; elsewhere, the teacher's.
    """
    target, weight = batch.rock, batch.counted
    if batch.taught is not None:
        share = 1 - (1 - _TEACHER_WEIGHT) * batch.counted
        target = (1 - share) * batch.rock + share * batch.taught
        weight = torch.clamp(batch.counted, min=_TEACHER_WEIGHT)
    entropy = functional.binary_cross_entropy_with_logits(logits, target, weight, reduction='sum')
    iou = soft_iou(torch.sigmoid(logits) * batch.counted, batch.rock * batch.counted).mean()
    return entropy / weight.sum().clamp(min=1) + _IOU_WEIGHT * (1 - iou)


def soft_iou(probability: torch.Tensor, rock: torch.Tensor) -> torch.Tensor:
    """IoU of each crop. A far rock counts as much as a near one, except for specks."""
    intersection = (probability * rock).sum((1, 2))
    union = (probability + rock).sum((1, 2)) - intersection
    return (intersection + _SPECK_PX) / (union + _SPECK_PX)


def pixel_logits(net: OutlineNet, features: torch.Tensor) -> torch.Tensor:
    """Logit of each pixel, shape (n, height, width)."""
    return functional.pixel_shuffle(net(features), SIDE_PX)[:, 0]
