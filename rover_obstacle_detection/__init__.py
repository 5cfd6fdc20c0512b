"""Stereo obstacle detection for planetary rovers."""

from __future__ import annotations

import importlib

TYPE_CHECKING = False  # without importing typing, in which Ctrl-C would show a traceback
if TYPE_CHECKING:
    from typing import Any

    from rover_obstacle_detection.detection.config import DetectorConfig
    from rover_obstacle_detection.detection.detector import Detector
    from rover_obstacle_detection.detection.geometry.camera import StereoCamera
    from rover_obstacle_detection.detection.geometry.gravity import Gravity
    from rover_obstacle_detection.detection.result.detection import Detection

__all__ = ['Detection', 'Detector', 'DetectorConfig', 'Gravity', 'StereoCamera']
__version__ = '0.1.0'

_HOMES = {
    'Detection': 'result.detection',
    'Detector': 'detector',
    'DetectorConfig': 'config',
    'Gravity': 'geometry.gravity',
    'StereoCamera': 'geometry.camera',
}


def __getattr__(name: str) -> Any:
    # OpenCV takes a third of a second to load: `rover-obstacles --help` does without.
    if name not in _HOMES:
        msg = f'module {__name__!r} has no attribute {name!r}'
        raise AttributeError(msg)
    home = importlib.import_module(f'{__name__}.detection.{_HOMES[name]}')
    return getattr(home, name)
