"""The messages of one frame in the bag ``detections``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.messages.factory import MessageFactory
from rover_obstacle_detection.messages.image import encode_compressed_image
from rover_obstacle_detection.messages.outputs import OUTPUTS
from rover_obstacle_detection.offline.summary import FrameSummary

WRITTEN_OUTPUTS = (
    'obstacle_mask',
    'obstacle_points',
    'ground_points',
    'obstacle_grid',
    'obstacle_markers',
)
DIAGNOSTICS = '/diagnostics'

# diagnostic_msgs/DiagnosticStatus
_OK, _WARN = 0, 1


class TopicMessage(NamedTuple):
    """A message and where it belongs."""

    topic: str
    type_name: str
    message: Any


def frame_messages(
    namespace: str,
    header: Any,
    detection: Detection,
    summary: FrameSummary,
    overlay_jpeg: bytes,
    factory: MessageFactory,
) -> Iterator[TopicMessage]:
    """Yield the messages of a frame: results, and what viewers show.

    Parameters
    ----------
    namespace : str
        Of the camera.
    header : std_msgs/Header
        Header of the left image.
    detection : Detection
    summary : FrameSummary
    overlay_jpeg : bytes
        The overlay as a JPEG file.
    factory : MessageFactory
    """
    for name in WRITTEN_OUTPUTS:
        output = OUTPUTS[name]
        message = output.encode(detection, header, factory)
        yield TopicMessage(f'{namespace}/{name}', output.type_name, message)
    yield TopicMessage(
        f'{namespace}/detection_image/compressed',
        'sensor_msgs/msg/CompressedImage',
        encode_compressed_image(overlay_jpeg, header, factory),
    )
    yield TopicMessage(
        DIAGNOSTICS,
        'diagnostic_msgs/msg/DiagnosticArray',
        _diagnostics(namespace, header, detection.warnings, summary, factory),
    )


def _diagnostics(
    namespace: str,
    header: Any,
    warnings: tuple[str, ...],
    summary: FrameSummary,
    factory: MessageFactory,
) -> Any:
    # Names as in the live node's status, where it has the same figure.
    values = {
        'obstacles': str(summary.obstacles),
        'nearest obstacle (m)': _number(summary.nearest_obstacle_m, 2),
        'valid disparity (%)': _number(100 * summary.matched_share, 1),
        'obstacles (% of pixels)': _number(100 * summary.obstacle_share, 1),
        'unknown (% of pixels)': _number(100 * summary.unknown_share, 1),
        'camera height (m)': _number(summary.camera_height_m, 2),
        'camera pitch (deg)': _number(summary.camera_pitch_deg, 1),
    }
    status = factory.make(
        'diagnostic_msgs/msg/DiagnosticStatus',
        name=f'{namespace}/obstacle_detector: detection',
        hardware_id=namespace,
        level=_WARN if warnings else _OK,
        message='; '.join(warnings) or f'obstacles: {summary.obstacles}',
        values=[
            factory.make('diagnostic_msgs/msg/KeyValue', key=key, value=value)
            for key, value in values.items()
        ],
    )
    return factory.make('diagnostic_msgs/msg/DiagnosticArray', header=header, status=[status])


def _number(value: float, digits: int) -> str:
    return f'{value:.{digits}f}' if math.isfinite(value) else 'unknown'
