"""The training of the network from random weights: one branch first, then both together."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

import numpy as np
import torch
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel

from outline_training.crops import random_crop
from outline_training.examples import Example
from outline_training.network import OutlineNet, beside_its_mirror_image

_BATCH = 10
_PEAK_RATE, _LEAST_RATE = 3e-3, 1e-5
_WARM_UP_STEPS = 100
_WEIGHT_DECAY = 1e-2
_AVERAGING = 0.999
"""Decay of the running mean of the weights: about the last thousand steps count."""

_IOU_WEIGHT = 0.5
_SPECK_PX = 50
"""Pixels, of a crop's 25,600, below which a rock counts less."""

_REPORTED_EVERY = 100


def train_from_random_weights(
    examples: Sequence[Example], steps: int, seed: int = 0
) -> OutlineNet:
    """Train one branch, put it beside its mirror image, and train both together.

    Parameters
    ----------
    examples : sequence of Example
    steps : int
        At least 2. Half of them train the single branch.
    seed : int
        The same seed gives the same weights on the same machine.
    """
    torch.manual_seed(seed)
    generator = np.random.default_rng(seed)
    single = train(OutlineNet(branches=1), examples, steps // 2, generator)
    return train(beside_its_mirror_image(single), examples, steps - steps // 2, generator)


def train(
    net: OutlineNet, examples: Sequence[Example], steps: int, generator: np.random.Generator
) -> OutlineNet:
    """Minimise the loss of random crops by AdamW, and return the running mean of the weights."""
    mean = AveragedModel(net, multi_avg_fn=update_running_mean)
    optimizer = torch.optim.AdamW(net.parameters(), weight_decay=_WEIGHT_DECAY)
    net.to(memory_format=torch.channels_last)
    for step in range(steps):
        for group in optimizer.param_groups:
            group['lr'] = learning_rate(step, steps)
        crops = [
            random_crop(examples[generator.integers(len(examples))], generator)
            for _ in range(_BATCH)
        ]
        features, rock, counted = (torch.stack(each) for each in zip(*crops, strict=True))
        logits = pixel_logits(net, features.to(memory_format=torch.channels_last))
        loss = loss_of(logits, rock, counted)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        mean.update_parameters(net)
        if (step + 1) % _REPORTED_EVERY == 0:
            branches = len(net.branches)
            print(
                f'{branches} of 2 branches, step {step + 1} of {steps}: loss {loss.item():.3f}',
                file=sys.stderr,
            )
    averaged = mean.module
    assert isinstance(averaged, OutlineNet)
    return averaged


@torch.no_grad()
def update_running_mean(
    means: Sequence[torch.Tensor], values: Sequence[torch.Tensor], count: torch.Tensor
) -> None:
    """Update an exponential mean, of fewer steps at first so that it forgets the first weights."""
    decay = min(_AVERAGING, (1 + count.item()) / (10 + count.item()))
    for mean, value in zip(means, values, strict=True):
        mean.lerp_(value, 1 - decay)


def learning_rate(step: int, steps: int) -> float:
    """Learning rate that rises linearly at first, then falls as half a cosine."""
    warm_up = min(1.0, step / _WARM_UP_STEPS)
    falling = 0.5 * (1 + math.cos(math.pi * step / steps))
    return _PEAK_RATE * warm_up * falling + _LEAST_RATE


def loss_of(logits: torch.Tensor, rock: torch.Tensor, counted: torch.Tensor) -> torch.Tensor:
    """Cross-entropy of the counted pixels, plus a share of one minus the mean soft IoU."""
    entropy = functional.binary_cross_entropy_with_logits(logits, rock, reduction='none')
    iou = soft_iou(torch.sigmoid(logits) * counted, rock * counted).mean()
    return (entropy * counted).sum() / counted.sum().clamp(min=1) + _IOU_WEIGHT * (1 - iou)


def soft_iou(probability: torch.Tensor, rock: torch.Tensor) -> torch.Tensor:
    """IoU of each crop. A far rock counts as much as a near one, except for specks."""
    intersection = (probability * rock).sum((1, 2))
    union = (probability + rock).sum((1, 2)) - intersection
    return (intersection + _SPECK_PX) / (union + _SPECK_PX)


def pixel_logits(net: OutlineNet, features: torch.Tensor) -> torch.Tensor:
    """Logit of each pixel, shape (n, height, width)."""
    return functional.pixel_shuffle(net(features), 2)[:, 0]
