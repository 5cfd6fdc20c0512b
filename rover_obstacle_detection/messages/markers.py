"""Encode the obstacles of a detection as boxes and labels (``visualization_msgs/MarkerArray``)."""

from __future__ import annotations

import math
from typing import Any

from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.detection.result.obstacles import Obstacle
from rover_obstacle_detection.messages.factory import MessageFactory
from rover_obstacle_detection.pictures import KIND_COLOURS, height_counts, shown_obstacles

LABELS = 'labels'
"""Namespace of the labels. RViz and Foxglove can show and hide each namespace separately."""

# visualization_msgs/Marker
_CUBE = 1
_TEXT_VIEW_FACING = 9
_ADD = 0
_DELETEALL = 3

_LABEL_COLOUR = {'r': 1.0, 'g': 1.0, 'b': 1.0, 'a': 1.0}
# Opacity at confidence 0 and 1: always visible, never hiding the points inside.
_MIN_ALPHA, _MAX_ALPHA = 0.1, 0.6
# RViz rejects a box of zero size.
_MIN_EXTENT_M = 0.01
_LETTER_M = 0.06


def encode_markers(detection: Detection, header: Any, factory: MessageFactory) -> Any:
    """Make a ``visualization_msgs/MarkerArray`` that replaces all earlier markers.

    Each obstacle with 3D of its own gets a box in the namespace and colour of its kind, more
    opaque with higher confidence. The label above it shows confidence, kind and, where that makes
    it an obstacle, height: ``0.93 rock 0.31 m``.

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
    placed = [
        (number, obstacle)
        for number, obstacle in enumerate(shown_obstacles(detection))
        if all(map(math.isfinite, (*obstacle.minimum_m, *obstacle.maximum_m)))
    ]
    boxes = [_box(number, obstacle, header, factory) for number, obstacle in placed]
    labels = [_label(number, obstacle, detection, header, factory) for number, obstacle in placed]
    return factory.make('visualization_msgs/msg/MarkerArray', markers=[clear, *boxes, *labels])


def _box(number: int, obstacle: Obstacle, header: Any, factory: MessageFactory) -> Any:
    corners = zip('xyz', obstacle.minimum_m, obstacle.maximum_m, strict=True)
    extent = {axis: max(high - low, _MIN_EXTENT_M) for axis, low, high in corners}
    blue, green, red = (each / 255 for each in KIND_COLOURS[obstacle.kind])
    alpha = _MIN_ALPHA + obstacle.confidence * (_MAX_ALPHA - _MIN_ALPHA)
    return factory.make(
        'visualization_msgs/msg/Marker',
        header=header,
        ns=obstacle.kind,
        id=number,
        type=_CUBE,
        action=_ADD,
        pose=_upright(_centre(obstacle), factory),
        scale=factory.make('geometry_msgs/msg/Vector3', **extent),
        color=factory.make('std_msgs/msg/ColorRGBA', r=red, g=green, b=blue, a=alpha),
    )


def _label(
    number: int,
    obstacle: Obstacle,
    detection: Detection,
    header: Any,
    factory: MessageFactory,
) -> Any:
    up = detection.ground.up
    halves = [
        (high - low) / 2 for low, high in zip(obstacle.minimum_m, obstacle.maximum_m, strict=True)
    ]
    # One letter height above the top of the box.
    rise_m = sum(abs(part) * half for part, half in zip(up, halves, strict=True)) + _LETTER_M
    position = {
        axis: value + rise_m * part
        for (axis, value), part in zip(_centre(obstacle).items(), up, strict=True)
    }
    text = f'{obstacle.confidence:.2f} {obstacle.kind}'
    if height_counts(obstacle, detection.config.max_step):
        text += f' {obstacle.max_height_m:.2f} m'
    return factory.make(
        'visualization_msgs/msg/Marker',
        header=header,
        ns=LABELS,
        id=number,
        type=_TEXT_VIEW_FACING,
        action=_ADD,
        pose=_upright(position, factory),
        scale=factory.make('geometry_msgs/msg/Vector3', x=0.0, y=0.0, z=_LETTER_M),
        color=factory.make('std_msgs/msg/ColorRGBA', **_LABEL_COLOUR),
        text=text,
    )


def _centre(obstacle: Obstacle) -> dict[str, float]:
    corners = zip('xyz', obstacle.minimum_m, obstacle.maximum_m, strict=True)
    return {axis: (low + high) / 2 for axis, low, high in corners}


def _upright(position: dict[str, float], factory: MessageFactory) -> Any:
    return factory.make(
        'geometry_msgs/msg/Pose',
        position=factory.make('geometry_msgs/msg/Point', **position),
        orientation=factory.make('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=0.0, w=1.0),
    )
