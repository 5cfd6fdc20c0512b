"""What ``replay`` has written."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader

PERIOD_NS = 100_000_000
COMMAND = (sys.executable, '-m', 'rover_obstacle_detection', 'replay')
TYPES = {
    '/cam/obstacle_mask': 'sensor_msgs/msg/Image',
    '/cam/obstacle_points': 'sensor_msgs/msg/PointCloud2',
    '/cam/ground_points': 'sensor_msgs/msg/PointCloud2',
    '/cam/obstacle_grid': 'nav_msgs/msg/OccupancyGrid',
    '/cam/obstacle_markers': 'visualization_msgs/msg/MarkerArray',
    '/cam/detection_image/compressed': 'sensor_msgs/msg/CompressedImage',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
}


def summary_of(output: Path) -> dict[str, Any]:
    """Return the summary."""
    return json.loads((output / 'summary.json').read_text())


def detections_of(output: Path) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time in nanoseconds and message of all detections."""
    with AnyReader([output / 'detections']) as reader:
        for connection, time_ns, data in reader.messages():
            yield connection.topic, time_ns, reader.deserialize(data, connection.msgtype)
