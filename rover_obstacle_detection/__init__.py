"""Stereo obstacle detection for planetary rovers."""

from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detection import Detection
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.gravity import Gravity

__all__ = ['Detection', 'Detector', 'DetectorConfig', 'Gravity', 'StereoCamera']
__version__ = '0.1.0'
