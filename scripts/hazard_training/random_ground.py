"""Random ground to train on, and boxes that stand on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from draw_scenes import random_scene, random_wide_scene
from numpy.typing import NDArray

from rover_obstacle_detection.simulation.poses import CameraPose

Image = NDArray[np.float32]

_WITH_EDGES_SHARE, _WIDE_SHARE = 0.5, 0.25
"""Shares of ground with several edges, and of that of `training_wide`."""


@dataclass(frozen=True)
class Box:
    """An object with upright sides that follows the ground.

    Parameters
    ----------
    x_m, y_m : float
        Its middle.
    length_m, width_m, height_m : float
    turn_rad : float
    """

    x_m: float
    y_m: float
    length_m: float
    width_m: float
    height_m: float
    turn_rad: float

    def height(self, x_m: Image, y_m: Image) -> Image:
        """Height over the ground at positions of any shape."""
        cosine, sine = math.cos(self.turn_rad), math.sin(self.turn_rad)
        x, y = x_m - self.x_m, y_m - self.y_m
        inside = np.abs(x * cosine + y * sine) < self.length_m / 2
        inside &= np.abs(y * cosine - x * sine) < self.width_m / 2
        return np.where(inside, np.float32(self.height_m), np.float32(0))

    def grown(self, margin_m: float) -> Box:
        """Return a box that is wider by a margin on each side."""
        wider = 2 * margin_m
        return replace(self, length_m=self.length_m + wider, width_m=self.width_m + wider)


def random_ground(seed: int, generator: np.random.Generator) -> dict[str, Any]:
    """Draw a scene, as an entry of a suite."""
    kind = generator.uniform()
    if kind < _WIDE_SHARE:
        return random_wide_scene(seed, 'drawn')
    scene = random_scene(seed, 'drawn')
    if kind < _WIDE_SHARE + _WITH_EDGES_SHARE:
        scene['parameters']['terrain']['steps'] = random_edges(scene['parameters'], generator)
    return scene


def random_edges(
    camera: Mapping[str, float], generator: np.random.Generator
) -> list[dict[str, float]]:
    """Draw one to four edges or trenches one behind the other, sharp or rounded.

    In half of the grounds, all edges lead up or all lead down.
    """

    def between(low: float, high: float) -> float:
        return round(float(generator.uniform(low, high)), 3)

    def log_between(low: float, high: float) -> float:
        return round(math.exp(generator.uniform(math.log(low), math.log(high))), 3)

    view_m = camera['camera_height_m'] / math.tan(math.radians(camera['pitch_deg']))
    ahead_m = max(view_m * log_between(0.6, 1.5), 1.0)
    turn_deg = between(-65, 65)
    up, one_way = generator.uniform(size=2) < 0.5
    edges = []
    for _ in range(int(generator.integers(1, 5))):
        if not one_way:
            up = generator.uniform() < 0.5
        edge = {
            'ahead_m': round(ahead_m, 2),
            'turn_deg': round(turn_deg + between(-12, 12), 1),
            'rise_m': log_between(0.06, 0.5) if up else -log_between(0.06, 0.8),
            'run_m': log_between(0.02, 0.8),
            'waviness_m': log_between(0.01, 0.16),
        }
        if generator.uniform() < 0.35:
            edge['width_m'] = log_between(0.25, 1.6)
        edges.append(edge)
        ahead_m += edge.get('width_m', 0) + between(0.3, 1.5)
    return edges


def random_boxes(pose: CameraPose, view_m: float, generator: np.random.Generator) -> list[Box]:
    """Draw up to four boxes in view, none on half of the grounds."""

    def log_between(low: float, high: float) -> float:
        return math.exp(generator.uniform(math.log(low), math.log(high)))

    boxes = []
    x_m, y_m = pose.ground_below
    for _ in range(int(generator.integers(1, 5)) if generator.uniform() < 0.5 else 0):
        length_m, width_m = log_between(0.1, 4), log_between(0.1, 3)
        ahead_m = max(view_m * log_between(0.6, 2.5), 1.0) + max(length_m, width_m) / 2
        bearing = pose.heading_rad + generator.uniform(-0.6, 0.6)
        boxes.append(
            Box(
                x_m + ahead_m * math.cos(bearing),
                y_m + ahead_m * math.sin(bearing),
                length_m,
                width_m,
                log_between(0.15, 2.5),
                float(generator.uniform(0, math.pi)),
            )
        )
    return boxes
