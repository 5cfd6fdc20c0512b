"""The network that outlines obstacles, as it is trained."""

from __future__ import annotations

import torch
from torch import nn

from rover_obstacle_detection.detection.rocks.outline_features import FEATURES

FINE, MIDDLE, COARSE = 16, 24, 48
"""Channels at a half, a quarter and an eighth of the resolution."""

SIDE_PX = 2
"""Side of the square of pixels whose logits the network returns together."""


class Wide(nn.Module):
    """Two convolutions, the second of which also sees the input of the first."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.before = convolved(width, width)
        self.last = convolved(2 * width, width)

    def forward(self, channels: torch.Tensor) -> torch.Tensor:
        """Return the same shape."""
        return self.last(torch.cat((self.before(channels), channels), 1))


class OutlineNet(nn.Module):
    """A U-Net (Ronneberger et al. 2015): down to an eighth of the resolution, up to a half."""

    def __init__(self) -> None:
        super().__init__()
        self.fine = halved(len(FEATURES), FINE)
        self.middle = halved(FINE, MIDDLE)
        self.coarse = nn.Sequential(halved(MIDDLE, COARSE), Wide(COARSE), Wide(COARSE))
        self.to_middle = nn.ConvTranspose2d(COARSE, MIDDLE, 2, 2)
        self.merge_middle = nn.Sequential(
            convolved(2 * MIDDLE, MIDDLE), convolved(MIDDLE, MIDDLE), convolved(MIDDLE, MIDDLE)
        )
        self.to_fine = nn.ConvTranspose2d(MIDDLE, FINE, 2, 2)
        self.merge_fine = convolved(2 * FINE, FINE)
        self.out = nn.Conv2d(FINE, SIDE_PX**2, 3, 1, 1)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the logits of each square of pixels, shape (n, 4, height / 2, width / 2)."""
        fine = self.fine(features)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        middle = self.merge_middle(torch.cat((self.to_middle(coarse), middle), 1))
        fine = self.merge_fine(torch.cat((self.to_fine(middle), fine), 1))
        return self.out(fine)


def halved(channels: int, width: int) -> nn.Sequential:
    """Make the layers that halve the resolution."""
    return nn.Sequential(nn.Conv2d(channels, width, 4, 2, 1), nn.ReLU(), *convolved(width, width))


def convolved(channels: int, width: int) -> nn.Sequential:
    """Make a layer of 3 x 3 pixels."""
    return nn.Sequential(nn.Conv2d(channels, width, 3, 1, 1), nn.ReLU())
