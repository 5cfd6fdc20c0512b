"""What a detection is published as: the one table that the live node and the replay share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.messages.cloud import encode_cloud
from rover_obstacle_detection.messages.disparity import encode_disparity
from rover_obstacle_detection.messages.factory import MessageFactory
from rover_obstacle_detection.messages.image import encode_image
from rover_obstacle_detection.messages.markers import encode_markers
from rover_obstacle_detection.pictures import (
    Picture,
    overlay_picture,
    regions_picture,
    roughness_step_picture,
    seeds_picture,
)

KNOWN = 255

Encode = Callable[[Detection, Any, MessageFactory], Any]


@dataclass(frozen=True)
class Output:
    """One output topic.

    Parameters
    ----------
    type_name : str
        Such as ``sensor_msgs/msg/Image``.
    encode : callable
        Makes the message of a detection, the left image's header and a message factory.
    """

    type_name: str
    encode: Encode


def _mask(detection: Detection, header: Any, factory: MessageFactory) -> Any:
    return encode_image(detection.mask, 'mono8', header, factory)


def _obstacle_points(detection: Detection, header: Any, factory: MessageFactory) -> Any:
    return encode_cloud(detection.obstacle_points, header, factory)


def _ground_points(detection: Detection, header: Any, factory: MessageFactory) -> Any:
    return encode_cloud(detection.ground_points, header, factory)


def _known(detection: Detection, header: Any, factory: MessageFactory) -> Any:
    known = detection.known.astype(np.uint8) * np.uint8(KNOWN)
    return encode_image(known, 'mono8', header, factory)


def _picture(draw: Callable[[Detection], Picture]) -> Output:
    def encode(detection: Detection, header: Any, factory: MessageFactory) -> Any:
        return encode_image(draw(detection), 'bgr8', header, factory)

    return Output('sensor_msgs/msg/Image', encode)


OUTPUTS: Mapping[str, Output] = {
    'obstacle_mask': Output('sensor_msgs/msg/Image', _mask),
    'obstacle_points': Output('sensor_msgs/msg/PointCloud2', _obstacle_points),
    'ground_points': Output('sensor_msgs/msg/PointCloud2', _ground_points),
    'disparity': Output('stereo_msgs/msg/DisparityImage', encode_disparity),
    'obstacle_markers': Output('visualization_msgs/msg/MarkerArray', encode_markers),
    'detection_image': _picture(overlay_picture),
    'debug/known': Output('sensor_msgs/msg/Image', _known),
    'debug/regions': _picture(regions_picture),
    'debug/seeds': _picture(seeds_picture),
    'debug/roughness_step': _picture(roughness_step_picture),
}
"""Output topics by their names relative to the node's namespace."""
