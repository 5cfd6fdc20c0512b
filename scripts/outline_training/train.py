"""The training of the network."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import torch
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel

from outline_training.crops import random_crop
from outline_training.examples import Example
from outline_training.network import SIDE_PX, OutlineNet
from rover_obstacle_detection.detection.rocks.outline_model import OutlineModel

_BATCH = 10
_PEAK_RATE, _LATER_PEAK_RATE, _LEAST_RATE = 3e-3, 5e-4, 1e-5
_WARM_UP_STEPS = 100
_WEIGHT_DECAY = 1e-2
_AVERAGING = 0.999
"""Decay of the running mean of the weights: about the last thousand steps count."""

_TEACHER_WEIGHT = 0.7
_IOU_WEIGHT = 0.5
_SPECK_PX = 50
"""Pixels, of a crop's 25,600, below which a rock counts less."""

_REPORTED_EVERY = 100


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
    net = start or OutlineNet()
    peak = _LATER_PEAK_RATE if start else _PEAK_RATE
    mean = AveragedModel(net, multi_avg_fn=update_running_mean)
    optimizer = torch.optim.AdamW(net.parameters(), weight_decay=_WEIGHT_DECAY)
    began = time.monotonic()
    # The next batch is cut while the network learns from this one.
    with ThreadPoolExecutor(1) as pool:
        batch = pool.submit(random_batch, examples, generator, teacher)
        for step in range(steps):
            passed = (time.monotonic() - began) / 60 / minutes
            if passed >= 1:
                break
            for group in optimizer.param_groups:
                group['lr'] = learning_rate(step, max(step / steps, passed), peak)
            now = batch.result()
            batch = pool.submit(random_batch, examples, generator, teacher)
            loss = loss_of(pixel_logits(net, now.features), now)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            mean.update_parameters(net)
            if (step + 1) % _REPORTED_EVERY == 0:
                print(
                    f'step {step + 1} of {steps}, {(time.monotonic() - began) / 60:.1f} minutes: '
                    f'loss {loss.item():.3f}',
                    file=sys.stderr,
                )
    averaged = mean.module
    assert isinstance(averaged, OutlineNet)
    return averaged


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


@torch.no_grad()
def update_running_mean(
    means: Sequence[torch.Tensor], values: Sequence[torch.Tensor], count: torch.Tensor
) -> None:
    """Update an exponential mean, of fewer steps at first so that it forgets the first weights."""
    decay = min(_AVERAGING, (1 + count.item()) / (10 + count.item()))
    for mean, value in zip(means, values, strict=True):
        mean.lerp_(value, 1 - decay)


def learning_rate(step: int, progress: float, peak: float = _PEAK_RATE) -> float:
    """Learning rate that rises linearly at first, then falls as half a cosine."""
    warm_up = min(1.0, step / _WARM_UP_STEPS)
    falling = 0.5 * (1 + math.cos(math.pi * progress))
    return peak * warm_up * falling + _LEAST_RATE


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
