"""The network that judges the ground, as it is trained."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

from rover_obstacle_detection.detection.terrain.cell_features import FEATURES
from rover_obstacle_detection.detection.terrain.hazard_model import CLASSES

FINE, MIDDLE, COARSE = 16, 24, 32
"""Channels at a half, a quarter and an eighth of the resolution of the map."""

SIDE_CELLS = 2
"""Side of the square of cells whose logits the network returns together."""


class HazardNet(nn.Module):
    """A U-Net (Ronneberger et al. 2015): down to an eighth of the resolution, up to a half."""

    def __init__(self) -> None:
        super().__init__()
        self.fine = nn.Sequential(*halved(len(FEATURES), FINE), *convolved(FINE, FINE))
        self.middle = nn.Sequential(*halved(FINE, MIDDLE), *convolved(MIDDLE, MIDDLE))
        self.coarse = nn.Sequential(
            *halved(MIDDLE, COARSE), *convolved(COARSE, COARSE), *convolved(COARSE, COARSE)
        )
        self.to_middle = nn.ConvTranspose2d(COARSE, MIDDLE, 2, 2)
        self.merge_middle = nn.Sequential(
            *convolved(2 * MIDDLE, MIDDLE), *convolved(MIDDLE, MIDDLE)
        )
        self.to_fine = nn.ConvTranspose2d(MIDDLE, FINE, 2, 2)
        self.merge_fine = nn.Sequential(*convolved(2 * FINE, FINE), *convolved(FINE, FINE))
        self.out = nn.Conv2d(FINE, len(CLASSES) * SIDE_CELLS**2, 1)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the logits of each square of cells, shape (n, 12, rows / 2, columns / 2)."""
        fine = self.fine(features)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        middle = self.merge_middle(torch.cat((self.to_middle(coarse), middle), 1))
        fine = self.merge_fine(torch.cat((self.to_fine(middle), fine), 1))
        return self.out(fine)


def cell_logits(net: HazardNet, features: torch.Tensor) -> torch.Tensor:
    """Logits of each cell, shape (n, classes, rows, columns)."""
    return functional.pixel_shuffle(net(features), SIDE_CELLS)


def halved(channels: int, width: int) -> tuple[nn.Module, ...]:
    """Layers that halve the resolution."""
    return nn.Conv2d(channels, width, 4, 2, 1), nn.ReLU()


def convolved(channels: int, width: int) -> tuple[nn.Module, ...]:
    """Layers of 3 x 3 cells."""
    return nn.Conv2d(channels, width, 3, 1, 1), nn.ReLU()
