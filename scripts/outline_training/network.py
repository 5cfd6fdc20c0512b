"""The network that outlines obstacles, as it is trained."""

from __future__ import annotations

import torch
from torch import nn

from rover_obstacle_detection.detection.rocks.outline_features import FEATURES

FINE, MIDDLE, COARSE = 16, 24, 48
"""Channels at a half, a quarter and an eighth of the resolution."""

# The four logits of 2 x 2 pixels, row by row, with left and right exchanged.
_MIRRORED_PIXELS = [1, 0, 3, 2]


class Corrected(nn.Module):
    """Adds a correction to its input (He et al. 2016). The correction is zero before training."""

    def __init__(self, width: int, convolutions: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for _ in range(convolutions):
            layers += [nn.Conv2d(width, width, 3, 1, 1), nn.ReLU()]
        last = layers[-2]
        assert isinstance(last, nn.Conv2d)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.correction = nn.Sequential(*layers[:-1])

    def forward(self, channels: torch.Tensor) -> torch.Tensor:
        """Return the same shape."""
        return torch.relu(channels + self.correction(channels))


class Branch(nn.Module):
    """A U-Net (Ronneberger et al. 2015): down to an eighth of the resolution, up to a half."""

    def __init__(self) -> None:
        super().__init__()
        self.down = nn.ModuleList(
            nn.Sequential(
                nn.Conv2d(before, after, 4, 2, 1),
                nn.ReLU(),
                nn.Conv2d(after, after, 3, 1, 1),
                nn.ReLU(),
            )
            for before, after in ((len(FEATURES), FINE), (FINE, MIDDLE), (MIDDLE, COARSE))
        )
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(before, after, 2, 2)
            for before, after in ((COARSE, MIDDLE), (MIDDLE, FINE))
        )
        self.merge = nn.ModuleList(
            nn.Sequential(nn.Conv2d(2 * width, width, 3, 1, 1), nn.ReLU())
            for width in (MIDDLE, FINE)
        )
        self.correct_coarse = nn.Sequential(Corrected(COARSE, 2), Corrected(COARSE, 2))
        self.correct_middle = nn.Sequential(Corrected(MIDDLE, 1), Corrected(MIDDLE, 1))

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return shape (n, FINE, height / 2, width / 2)."""
        half = self.down[0](features)
        quarter = self.down[1](half)
        eighth = self.correct_coarse(self.down[2](quarter))
        middle = self.merge[0](torch.cat((self.up[0](eighth), quarter), 1))
        middle = self.correct_middle(middle)
        return self.merge[1](torch.cat((self.up[1](middle), half), 1))


class OutlineNet(nn.Module):
    """Branches side by side, and a convolution that makes logits of what they return."""

    def __init__(self, branches: int = 1) -> None:
        super().__init__()
        self.branches = nn.ModuleList(Branch() for _ in range(branches))
        self.out = nn.Conv2d(branches * FINE, 4, 3, 1, 1)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return four logits for each 2 x 2 pixels, shape (n, 4, height / 2, width / 2)."""
        return self.out(torch.cat([branch(features) for branch in self.branches], 1))


def beside_its_mirror_image(single: OutlineNet) -> OutlineNet:
    """Put a trained branch beside a copy of itself that sees left and right exchanged.

    The result returns the mean of what `single` returns for an image and for its mirror image.
    """
    both = OutlineNet(branches=2)
    for branch in both.branches:
        branch.load_state_dict(single.branches[0].state_dict())
    for module in both.branches[1].modules():
        if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
            module.weight.data = module.weight.data.flip(-1)
    weight, bias = single.out.weight.data, single.out.bias.data
    mirrored_weight = weight.flip(-1)[_MIRRORED_PIXELS]
    both.out.weight.data = torch.cat((weight, mirrored_weight), 1) / 2
    both.out.bias.data = (bias + bias[_MIRRORED_PIXELS]) / 2
    return both
