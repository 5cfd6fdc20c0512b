"""The network that outlines obstacles, as it is trained."""

from __future__ import annotations

import torch
from torch import nn

from rover_obstacle_detection.detection.rocks.outline_features import FEATURES

FINE, MIDDLE, COARSE = 32, 48, 64
"""Channels at a quarter, an eighth and a sixteenth of the resolution."""

SIDE_PX = 4
"""Side of the square of pixels whose logits the network returns together."""


class Corrected(nn.Module):
    """Adds a correction to its input (He et al. 2016). The correction is zero before training."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.correction = nn.Conv2d(width, width, 3, 1, 1)
        nn.init.zeros_(self.correction.weight)
        nn.init.zeros_(self.correction.bias)

    def forward(self, channels: torch.Tensor) -> torch.Tensor:
        """Return the same shape."""
        return torch.relu(channels + self.correction(channels))


class OutlineNet(nn.Module):
    """A U-Net (Ronneberger et al. 2015): down to a sixteenth of the resolution, up to a quarter.

    Its first convolution sees squares of pixels, whose details it hands to the last one.
    """

    def __init__(self) -> None:
        super().__init__()
        self.fine = corrected(nn.Conv2d(len(FEATURES), FINE, SIDE_PX, SIDE_PX), 1)
        self.middle = corrected(nn.Conv2d(FINE, MIDDLE, 4, 2, 1), 1)
        self.coarse = corrected(nn.Conv2d(MIDDLE, COARSE, 4, 2, 1), 5)
        self.to_middle = nn.ConvTranspose2d(COARSE, MIDDLE, 2, 2)
        self.merge_middle = corrected(nn.Conv2d(2 * MIDDLE, MIDDLE, 1), 2)
        self.to_fine = nn.ConvTranspose2d(MIDDLE, FINE, 2, 2)
        self.merge_fine = corrected(nn.Conv2d(2 * FINE, FINE, 1), 1)
        self.out = nn.Conv2d(FINE, SIDE_PX**2, 3, 1, 1)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the logits of each square of pixels, shape (n, 16, height / 4, width / 4)."""
        fine = self.fine(features)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        middle = self.merge_middle(torch.cat((self.to_middle(coarse), middle), 1))
        return self.out(self.merge_fine(torch.cat((self.to_fine(middle), fine), 1)))


def corrected(first: nn.Conv2d, corrections: int) -> nn.Sequential:
    """Make a layer and its corrections."""
    width = first.out_channels
    return nn.Sequential(first, nn.ReLU(), *(Corrected(width) for _ in range(corrections)))
