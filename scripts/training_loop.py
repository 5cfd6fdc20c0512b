"""How networks are trained: AdamW, a rate that rises and falls, and a running mean of weights."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import torch
from torch import nn
from torch.optim.swa_utils import AveragedModel

Net = TypeVar('Net', bound=nn.Module)
Batch = TypeVar('Batch')

PEAK_RATE = 3e-3
_LEAST_RATE = 1e-5
_WARM_UP_STEPS = 100
_WEIGHT_DECAY = 1e-2
_AVERAGING = 0.999
"""Decay of the running mean of the weights: about the last thousand steps count."""

_REPORTED_EVERY = 100


def minimise(
    net: Net,
    next_batch: Callable[[], Batch],
    loss_of: Callable[[Net, Batch], torch.Tensor],
    steps: int,
    minutes: float = math.inf,
    peak_rate: float = PEAK_RATE,
) -> Net:
    """Minimise a loss by AdamW, and return the network with the running mean of its weights.

    Parameters
    ----------
    net : Module
        Its weights are changed.
    next_batch : callable
        Called once more than there are steps, in another thread.
    loss_of : callable
    steps : int
    minutes : float
        The training ends after this time if the steps take longer. The learning rate falls in
        time for whichever comes first.
    peak_rate : float
        Highest learning rate.
    """
    mean = AveragedModel(net, multi_avg_fn=update_running_mean)
    optimizer = torch.optim.AdamW(net.parameters(), weight_decay=_WEIGHT_DECAY)
    began = time.monotonic()
    # The next batch is made while the network learns from this one.
    with ThreadPoolExecutor(1) as pool:
        batch = pool.submit(next_batch)
        for step in range(steps):
            passed = (time.monotonic() - began) / 60 / minutes
            if passed >= 1:
                break
            for group in optimizer.param_groups:
                group['lr'] = learning_rate(step, max(step / steps, passed), peak_rate)
            now = batch.result()
            batch = pool.submit(next_batch)
            loss = loss_of(net, now)
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
    assert isinstance(averaged, type(net))
    return averaged


@torch.no_grad()
def update_running_mean(
    means: Sequence[torch.Tensor], values: Sequence[torch.Tensor], count: torch.Tensor
) -> None:
    """Update an exponential mean, of fewer steps at first so that it forgets the first weights."""
    decay = min(_AVERAGING, (1 + count.item()) / (10 + count.item()))
    for mean, value in zip(means, values, strict=True):
        mean.lerp_(value, 1 - decay)


def learning_rate(step: int, progress: float, peak: float = PEAK_RATE) -> float:
    """Learning rate that rises linearly at first, then falls as half a cosine."""
    warm_up = min(1.0, step / _WARM_UP_STEPS)
    falling = 0.5 * (1 + math.cos(math.pi * progress))
    return peak * warm_up * falling + _LEAST_RATE
