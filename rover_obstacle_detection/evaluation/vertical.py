"""Pitch and roll of a camera from the vertical in its frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rover_obstacle_detection.detection.geometry.gravity import Gravity


def angles_deg(up: Sequence[float]) -> tuple[float, float]:
    """Pitch below the horizon and clockwise roll of a camera, from its up vector."""
    pitch = math.asin(max(-1.0, min(1.0, -up[2])))
    return math.degrees(pitch), math.degrees(math.atan2(-up[0], -up[1]))


def angle_between_deg(first: Gravity, second: Sequence[float]) -> float:
    """Angle between two verticals, degrees."""
    cosine = float(np.dot(first.up, second))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
