"""Runs of the hybrid method on synthetic scenes."""

from __future__ import annotations

import numpy as np
from synthetic import Box, render

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector

BLOCK = (Box(0.0, 1.2, 0.3, 0.3, 0.3),)


def detect(scene, *, gravity=True, **config):
    view = render(scene)
    known = scene.gravity if gravity else None
    found = Detector(scene.camera, DetectorConfig(**config)).detect(
        view.left, view.right, gravity=known
    )
    return found, view


def flagged(found, where) -> float:
    return np.count_nonzero(found.mask[where]) / np.count_nonzero(where)
