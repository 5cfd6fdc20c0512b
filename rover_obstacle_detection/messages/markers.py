"""A detection's obstacles as boxes: ``visualization_msgs/MarkerArray``."""

from __future__ import annotations

import math
from typing import Any

from rover_obstacle_detection.detection.detection import Detection
from rover_obstacle_detection.detection.obstacles import Obstacle
from rover_obstacle_detection.messages.factory import MessageFactory

# visualization_msgs/Marker
_CUBE = 1
_ADD = 0
_DELETEALL = 3

_COLOUR = {'r': 0.94, 'g': 0.06, 'b': 0.19, 'a': 0.5}
# RViz refuses a box without extent.
_MIN_EXTENT_M = 0.01


def encode_markers(detection: Detection, header: Any, factory: MessageFactory) -> Any:
    """Make a ``visualization_msgs/MarkerArray``: the former boxes go, one box per obstacle comes.

    Obstacles without 3D, which have no place in space, have no box.

    Parameters
    ----------
    detection : Detection
    header : std_msgs/Header
    factory : MessageFactory
    """
    clear = factory.make(
        'visualization_msgs/msg/Marker',
        header=header,
        action=_DELETEALL,
        pose=_upright({}, factory),
    )
    boxes = [
        _box(number, obstacle, header, factory)
        for number, obstacle in enumerate(detection.obstacles)
        if all(map(math.isfinite, (*obstacle.minimum_m, *obstacle.maximum_m)))
    ]
    return factory.make('visualization_msgs/msg/MarkerArray', markers=[clear, *boxes])


def _box(number: int, obstacle: Obstacle, header: Any, factory: MessageFactory) -> Any:
    corners = list(zip('xyz', obstacle.minimum_m, obstacle.maximum_m, strict=True))
    centre = {axis: (low + high) / 2 for axis, low, high in corners}
    extent = {axis: max(high - low, _MIN_EXTENT_M) for axis, low, high in corners}
    return factory.make(
        'visualization_msgs/msg/Marker',
        header=header,
        ns='obstacles',
        id=number,
        type=_CUBE,
        action=_ADD,
        pose=_upright(centre, factory),
        scale=factory.make('geometry_msgs/msg/Vector3', **extent),
        color=factory.make('std_msgs/msg/ColorRGBA', **_COLOUR),
    )


def _upright(position: dict[str, float], factory: MessageFactory) -> Any:
    return factory.make(
        'geometry_msgs/msg/Pose',
        position=factory.make('geometry_msgs/msg/Point', **position),
        orientation=factory.make('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=0.0, w=1.0),
    )
