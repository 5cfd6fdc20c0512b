"""The output topics and their messages, shared by the live node and the replay."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.detection.result.grid import unknown_grid
from rover_obstacle_detection.messages.camera_info import encode_camera_info
from rover_obstacle_detection.messages.cloud import GROUND_FIELDS, encode_cloud
from rover_obstacle_detection.messages.disparity import encode_disparity
from rover_obstacle_detection.messages.factory import MessageFactory
from rover_obstacle_detection.messages.grid import encode_grid
from rover_obstacle_detection.messages.image import encode_image
from rover_obstacle_detection.messages.markers import encode_markers
from rover_obstacle_detection.pictures import (
    overlay_picture,
    regions_picture,
    roughness_step_picture,
    seeds_picture,
)

# Pixel value of debug/known where the ground was judged.
KNOWN = np.uint8(255)


EncodeUnknown = Callable[[tuple[int, int], DetectorConfig, Any, MessageFactory], Any]


@dataclass(frozen=True)
class Output:
    """One output topic.

    Parameters
    ----------
    type_name : str
        For example ``sensor_msgs/msg/Image``.
    encode : callable
        Makes the message from a detection, the left image's header and a message factory.
    encode_unknown : callable, optional
        Makes the message for a pair that cannot be judged, from the images' height and width,
        the detector's configuration, the left image's header and a message factory. None: no
        message, because every message of this topic would say that there is no obstacle.
    """

    type_name: str
    encode: Callable[[Detection, Any, MessageFactory], Any]
    encode_unknown: EncodeUnknown | None = None


def _image(pixels: Callable[[Detection], NDArray[np.uint8]], encoding: str) -> Output:
    return Output(
        'sensor_msgs/msg/Image',
        lambda detection, header, factory: encode_image(
            pixels(detection), encoding, header, factory
        ),
    )


def _no_ground(
    shape: tuple[int, int], config: DetectorConfig, header: Any, factory: MessageFactory
) -> Any:
    return encode_cloud(np.zeros((0, len(GROUND_FIELDS)), np.float32), header, factory)


def _nothing_known(
    shape: tuple[int, int], config: DetectorConfig, header: Any, factory: MessageFactory
) -> Any:
    return encode_image(np.zeros(shape, np.uint8), 'mono8', header, factory)


def _unknown_cells(
    shape: tuple[int, int], config: DetectorConfig, header: Any, factory: MessageFactory
) -> Any:
    grid = unknown_grid(config.grid_cell, config.grid_extent, upside_down=config.upside_down)
    return encode_grid(grid, header, factory)


OUTPUTS: Mapping[str, Output] = {
    'obstacle_mask': _image(lambda detection: detection.mask, 'mono8'),
    'obstacle_points': Output(
        'sensor_msgs/msg/PointCloud2',
        lambda detection, header, factory: encode_cloud(
            detection.obstacle_points, header, factory, detection.obstacle_point_kinds
        ),
    ),
    'ground_points': Output(
        'sensor_msgs/msg/PointCloud2',
        lambda detection, header, factory: encode_cloud(detection.ground_points, header, factory),
        _no_ground,
    ),
    'obstacle_grid': Output(
        'nav_msgs/msg/OccupancyGrid',
        lambda detection, header, factory: encode_grid(detection.grid, header, factory),
        _unknown_cells,
    ),
    'disparity': Output('stereo_msgs/msg/DisparityImage', encode_disparity),
    'camera_info': Output(
        'sensor_msgs/msg/CameraInfo',
        lambda detection, header, factory: encode_camera_info(detection.camera, header, factory),
    ),
    'obstacle_markers': Output('visualization_msgs/msg/MarkerArray', encode_markers),
    'detection_image': _image(overlay_picture, 'bgr8'),
    'debug/known': replace(
        _image(lambda detection: detection.known * KNOWN, 'mono8'), encode_unknown=_nothing_known
    ),
    'debug/regions': _image(regions_picture, 'bgr8'),
    'debug/seeds': _image(seeds_picture, 'bgr8'),
    'debug/roughness_step': _image(roughness_step_picture, 'bgr8'),
}
"""Output topics by their name relative to the node's namespace."""
