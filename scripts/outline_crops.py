"""Crops of training examples, varied as cameras, light and ground vary."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from rover_obstacle_detection.detection.rocks.outline_features import PARALLAX_PLANES, PLANES

CROP = 160
HEIGHT = PLANES.index('height over the step')
STANDING = PLANES.index('standing part')
HEIGHT_OVER_NOISE = PLANES.index('height over its noise')
HEIGHT_NOISE = PLANES.index('noise over the step')
DISPARITY_NOISE = PLANES.index('disparity noise')
MEASURED = PLANES.index('measured')
SCALE = PLANES.index('scale')
GREY = PLANES.index('grey level against the ground')


@dataclass(frozen=True)
class Example:
    """Planes of a frame, which pixels are on rocks, which count, and where to look."""

    planes: torch.Tensor
    rock: torch.Tensor
    counted: torch.Tensor
    places: NDArray[np.intp]


def crop(
    example: Example, generator: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Cut out a square, mostly around something, at a random scale and contrast."""
    height, width = example.rock.shape
    factor = math.exp(generator.uniform(math.log(0.7), math.log(1.5)))
    if generator.random() > 0.6:
        factor = 1.0
    size = min(int(CROP / factor), height, width)
    if len(example.places) and generator.random() < 0.75:
        row, column = example.places[generator.integers(len(example.places))]
        row += generator.integers(-size // 3, size // 3 + 1)
        column += generator.integers(-size // 3, size // 3 + 1)
    else:
        row, column = generator.integers(height), generator.integers(width)
    top = int(np.clip(row - size // 2, 0, height - size))
    left = int(np.clip(column - size // 2, 0, width - size))
    window = np.s_[..., top : top + size, left : left + size]
    planes = example.planes[window].float()[None]
    targets = torch.stack((example.rock[window], example.counted[window])).float()[None]
    if size != CROP:
        planes = functional.interpolate(planes, (CROP, CROP), mode='bilinear')
        targets = functional.interpolate(targets, (CROP, CROP), mode='nearest')
        planes[:, MEASURED] = (planes[:, MEASURED] > 0.5).float()
        planes[:, SCALE] += math.log(CROP / size) / 3
    disturb(planes, generator)
    bumps = torch.from_numpy(generator.normal(0, 1, (1, 1, CROP // 16, CROP // 16)))
    bumps = functional.interpolate(bumps.float(), (CROP, CROP), mode='bilinear')
    planes[:, HEIGHT] += bumps[:, 0] * generator.uniform(0, 0.08)
    if generator.random() < 0.25:
        hide_a_side(planes, generator)
    if generator.random() < 0.35:
        shade(planes, targets[0, 0], generator)
    if generator.random() < 0.5:
        planes, targets = planes.flip(-1), targets.flip(-1)
    return planes[0], targets[0, 0], targets[0, 1]


def disturb(planes: torch.Tensor, generator: np.random.Generator) -> None:
    """Vary what cameras and light vary: contrast, image noise, focus, how well all is known."""

    def factor(spread: float) -> float:
        return math.exp(generator.normal(0, spread))

    planes[:, GREY] *= factor(0.35)
    planes[:, GREY] += generator.normal(0, 0.08)
    if generator.random() < 0.3:
        planes[:, GREY] += torch.randn(CROP, CROP) * generator.uniform(0, 0.2)
    if generator.random() < 0.2:
        planes[:, GREY] = functional.avg_pool2d(planes[:, GREY], 3, 1, 1)
    planes[:, HEIGHT] *= factor(0.03)
    planes[:, PARALLAX_PLANES] *= factor(0.25)
    noise = factor(0.12)
    planes[:, (HEIGHT_NOISE, DISPARITY_NOISE)] *= noise
    planes[:, HEIGHT_OVER_NOISE] /= noise


def hide_a_side(planes: torch.Tensor, generator: np.random.Generator) -> None:
    """Take the 3D from one side of a crop, as from the border that the right eye does not see."""
    columns, rows = torch.arange(CROP)[None], torch.arange(CROP)[:, None]
    border = generator.uniform(0.15, 0.85) * CROP
    border = border + generator.uniform(-0.4, 0.4) * (rows - CROP / 2)
    border = border.round().clamp(0, CROP - 1).long()
    source = torch.maximum(columns, border).expand(CROP, CROP)
    for number in range(len(PLANES)):
        if number not in (MEASURED, GREY, *PARALLAX_PLANES):
            planes[0, number] = planes[0, number].gather(1, source)
    planes[:, (MEASURED, *PARALLAX_PLANES)] *= (columns >= border).float()


def shade(planes: torch.Tensor, rock: torch.Tensor, generator: np.random.Generator) -> None:
    """Draw a strip, a half or a corner darker or brighter: tape, wheel tracks, a thrown shadow.

    In one case of two it lies on the ground alone, in the other over rocks as well.
    """
    columns, rows = np.meshgrid(np.arange(CROP) - CROP / 2, np.arange(CROP) - CROP / 2)
    angle = generator.uniform(0, 2 * math.pi)
    across = columns * math.cos(angle) + rows * math.sin(angle) + generator.normal(0, CROP / 4)
    inside = across > 0
    if generator.random() < 0.5:
        inside = np.abs(across) < math.exp(generator.uniform(math.log(6), math.log(CROP))) / 2
    if generator.random() < 0.5:
        angle += generator.uniform(0.4, math.pi - 0.4)
        cut = columns * math.cos(angle) + rows * math.sin(angle)
        inside &= cut + generator.normal(0, 0.3 * CROP) > 0
    if generator.random() < 0.5:
        inside &= ~(rock.numpy() > 0)
    share = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), generator.uniform(0.5, 3))
    dark = generator.random() < 0.75
    level = -generator.uniform(0.3, 1.6) if dark else generator.uniform(0.2, 0.9)
    planes[0, GREY] += torch.from_numpy(share) * level
