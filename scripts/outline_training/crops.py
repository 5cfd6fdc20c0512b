"""Crops of training examples, varied as cameras, light and ground vary."""

from __future__ import annotations

import math

import cv2
import numpy as np
import torch
from torch.nn import functional

from outline_training.examples import Example
from rover_obstacle_detection.detection.rocks.outline_features import FEATURES, PARALLAX_FEATURES

CROP_PX = 160
"""Side of a crop, a multiple of sixteen: the network reduces the resolution as much."""

HEIGHT = FEATURES.index('height over the step')
HEIGHT_OVER_NOISE = FEATURES.index('height over its noise')
HEIGHT_NOISE = FEATURES.index('noise over the step')
DISPARITY_NOISE = FEATURES.index('disparity noise')
MEASURED = FEATURES.index('measured')
SCALE = FEATURES.index('scale')
GREY = FEATURES.index('grey level against the ground')

# Shares of the crops.
_AROUND_AN_OBSTACLE = 0.75
_RESIZED = 0.6
_GREY_NOISY = 0.3
_BLURRED = 0.2
_WITHOUT_3D_ON_A_SIDE = 0.25
_SHADED = 0.35
_MIRRORED = 0.5

_SMALLEST, _LARGEST = 0.7, 1.5
"""Factors by which a crop is resized."""

_MAX_BUMPS_STEPS, _BUMP_PX = 0.08, 16
"""Unevenness that is added to the ground: its standard deviation over the step, and its size."""


def random_crop(
    example: Example, generator: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Cut a square out of an example, mostly around an obstacle, and vary it.

    Returns
    -------
    features : Tensor of float32, shape (features, CROP_PX, CROP_PX)
    rock, counted : Tensor of float32, shape (CROP_PX, CROP_PX)
        1 on rocks; and 1 where the labels count.
    """
    window, size = random_window(example, generator)
    features = example.features[window].float()[None]
    labels = torch.stack((example.rock[window], example.counted[window])).float()[None]
    if size != CROP_PX:
        features = functional.interpolate(features, (CROP_PX, CROP_PX), mode='bilinear')
        labels = functional.interpolate(labels, (CROP_PX, CROP_PX), mode='nearest')
        features[:, MEASURED] = (features[:, MEASURED] > 0.5).float()
        # The definition of this feature has the same logarithm over the same number.
        features[:, SCALE] += math.log(CROP_PX / size) / 3
    vary_camera_and_light(features, generator)
    add_bumps(features, generator)
    if generator.random() < _WITHOUT_3D_ON_A_SIDE:
        hide_a_side(features, generator)
    if generator.random() < _SHADED:
        shade(features, labels[0, 0], generator)
    if generator.random() < _MIRRORED:
        features, labels = features.flip(-1), labels.flip(-1)
    return features[0], labels[0, 0], labels[0, 1]


def random_window(
    example: Example, generator: np.random.Generator
) -> tuple[tuple[object, slice, slice], int]:
    """Choose the pixels of a crop, and return them with the number of their rows and columns."""
    height, width = example.rock.shape
    factor = 1.0
    if generator.random() < _RESIZED:
        factor = math.exp(generator.uniform(math.log(_SMALLEST), math.log(_LARGEST)))
    size = min(int(CROP_PX / factor), height, width)
    if len(example.places) and generator.random() < _AROUND_AN_OBSTACLE:
        row, column = example.places[generator.integers(len(example.places))]
        row += generator.integers(-size // 3, size // 3 + 1)
        column += generator.integers(-size // 3, size // 3 + 1)
    else:
        row, column = generator.integers(height), generator.integers(width)
    top = int(np.clip(row - size // 2, 0, height - size))
    left = int(np.clip(column - size // 2, 0, width - size))
    return np.s_[..., top : top + size, left : left + size], size


def vary_camera_and_light(features: torch.Tensor, generator: np.random.Generator) -> None:
    """Vary contrast, brightness, image noise, focus, and the noise of 3D."""

    def factor(spread: float) -> float:
        return math.exp(generator.normal(0, spread))

    features[:, GREY] *= factor(0.35)
    features[:, GREY] += generator.normal(0, 0.08)
    if generator.random() < _GREY_NOISY:
        noise = generator.standard_normal((CROP_PX, CROP_PX), np.float32)
        features[:, GREY] += torch.from_numpy(noise) * generator.uniform(0, 0.2)
    if generator.random() < _BLURRED:
        features[:, GREY] = functional.avg_pool2d(features[:, GREY], 3, 1, 1)
    features[:, HEIGHT] *= factor(0.03)
    features[:, PARALLAX_FEATURES] *= factor(0.25)
    noise_factor = factor(0.12)
    features[:, (HEIGHT_NOISE, DISPARITY_NOISE)] *= noise_factor
    features[:, HEIGHT_OVER_NOISE] /= noise_factor


def add_bumps(features: torch.Tensor, generator: np.random.Generator) -> None:
    """Make the ground uneven."""
    side = CROP_PX // _BUMP_PX
    bumps = torch.from_numpy(generator.standard_normal((1, 1, side, side), np.float32))
    bumps = functional.interpolate(bumps, (CROP_PX, CROP_PX), mode='bilinear')
    features[:, HEIGHT] += bumps[:, 0] * generator.uniform(0, _MAX_BUMPS_STEPS)


def hide_a_side(features: torch.Tensor, generator: np.random.Generator) -> None:
    """Remove 3D from the left of a crop, as if it were not visible in the right image."""
    columns, rows = torch.arange(CROP_PX)[None], torch.arange(CROP_PX)[:, None]
    border = generator.uniform(0.15, 0.85) * CROP_PX
    border = border + generator.uniform(-0.4, 0.4) * (rows - CROP_PX / 2)
    border = border.round().clamp(0, CROP_PX - 1).long()
    source = torch.maximum(columns, border).expand(CROP_PX, CROP_PX)
    for number in range(len(FEATURES)):
        if number not in (MEASURED, GREY, *PARALLAX_FEATURES):
            features[0, number] = features[0, number].gather(1, source)
    features[:, (MEASURED, *PARALLAX_FEATURES)] *= (columns >= border).float()


def shade(features: torch.Tensor, rock: torch.Tensor, generator: np.random.Generator) -> None:
    """Make a strip, a half or a corner darker or brighter, like a shadow or a wheel track.

    In half of the cases rocks keep their grey level.
    """
    columns, rows = np.meshgrid(np.arange(CROP_PX) - CROP_PX / 2, np.arange(CROP_PX) - CROP_PX / 2)
    angle = generator.uniform(0, 2 * math.pi)
    across = columns * math.cos(angle) + rows * math.sin(angle) + generator.normal(0, CROP_PX / 4)
    inside = across > 0
    if generator.random() < 0.5:
        inside = np.abs(across) < math.exp(generator.uniform(math.log(6), math.log(CROP_PX))) / 2
    if generator.random() < 0.5:
        angle += generator.uniform(0.4, math.pi - 0.4)
        cut = columns * math.cos(angle) + rows * math.sin(angle)
        inside &= cut + generator.normal(0, 0.3 * CROP_PX) > 0
    if generator.random() < 0.5:
        inside &= ~(rock.numpy() > 0)
    share = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), generator.uniform(0.5, 3))
    dark = generator.random() < 0.75
    level = -generator.uniform(0.3, 1.6) if dark else generator.uniform(0.2, 0.9)
    features[0, GREY] += torch.from_numpy(share) * level
