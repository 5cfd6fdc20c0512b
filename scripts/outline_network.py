"""The network that draws the outlines of obstacles, as it is trained and as it is exported."""

from __future__ import annotations

import torch
from torch import nn

from rover_obstacle_detection.detection.rocks.outline_features import PLANES


class Corrected(nn.Module):
    """What comes in and a correction to it (He et al. 2016), which is nothing before training."""

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

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        """Return the same shape."""
        return torch.relu(planes + self.correction(planes))


class Folded(nn.Module):
    """The same without a sum, which OpenCV 4.8 cannot import: the last convolution adds."""

    def __init__(self, corrected: Corrected) -> None:
        super().__init__()
        *before, last = corrected.correction
        assert isinstance(last, nn.Conv2d)
        self.before = nn.Sequential(*before) if before else None
        width = last.out_channels
        self.last = nn.Conv2d(width * (2 if before else 1), width, 3, 1, 1)
        weight = torch.zeros_like(self.last.weight)
        weight[:, :width] = last.weight.data
        weight[torch.arange(width), torch.arange(-width, 0), 1, 1] += 1
        self.last.weight.data = weight
        self.last.bias.data = last.bias.data.clone()

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        """Return what the other would."""
        if self.before is not None:
            planes = torch.cat((self.before(planes), planes), 1)
        return torch.relu(self.last(planes))


class Branch(nn.Module):
    """Halves the resolution three times and comes back to half of it."""

    def __init__(self, fine: int, middle: int, coarse: int) -> None:
        super().__init__()
        self.down = nn.ModuleList(
            nn.Sequential(
                nn.Conv2d(before, after, 4, 2, 1),
                nn.ReLU(),
                nn.Conv2d(after, after, 3, 1, 1),
                nn.ReLU(),
            )
            for before, after in ((len(PLANES), fine), (fine, middle), (middle, coarse))
        )
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(before, after, 2, 2)
            for before, after in ((coarse, middle), (middle, fine))
        )
        self.merge = nn.ModuleList(
            nn.Sequential(nn.Conv2d(2 * width, width, 3, 1, 1), nn.ReLU())
            for width in (middle, fine)
        )
        self.correct = nn.ModuleList(
            nn.Sequential(*(Corrected(width, convolutions) for _ in range(count)))
            for width, convolutions, count in ((coarse, 2, 2), (middle, 1, 2), (fine, 1, 0))
        )

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        """Return shape (n, fine, height / 2, width / 2)."""
        levels = []
        for down in self.down:
            planes = down(planes)
            levels.append(planes)
        planes = self.correct[0](planes)
        for up, merge, level, correct in zip(
            self.up, self.merge, levels[-2::-1], self.correct[1:], strict=True
        ):
            planes = correct(merge(torch.cat((up(planes), level), 1)))
        return planes


class OutlineNet(nn.Module):
    """Two branches side by side; four logits for each 2 x 2 pixels.

    Two that began as networks of their own, one of them mirrored, err less than one twice as wide.
    """

    def __init__(self, fine: int = 16, middle: int = 24, coarse: int = 48) -> None:
        super().__init__()
        self.branches = nn.ModuleList(Branch(fine, middle, coarse) for _ in range(2))
        self.out = nn.Conv2d(2 * fine, 4, 3, 1, 1)

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        """Return logits, shape (n, 4, height / 2, width / 2)."""
        return self.out(torch.cat([branch(planes) for branch in self.branches], 1))
