"""Run the node with a detector that returns its first result for every pair.

What is left of the node's time is reception, decoding, messages, publishing and diagnostics.

    python benchmarks/hollow_node.py -r __ns:=/stereo
"""

from __future__ import annotations

import sys
from typing import Any

from rover_obstacle_detection.node.main import run_node
from rover_obstacle_detection.node.transport import use_large_message_profile

# Before rclpy is loaded, which the worker's module does.
use_large_message_profile()

from rover_obstacle_detection.node import worker  # noqa: E402

detect = worker.detect_unswapped
first: list[Any] = []


def detect_once(*arguments: Any, **options: Any) -> Any:
    if not first:
        first.append(detect(*arguments, **options))
    return first[0]


if __name__ == '__main__':
    worker.detect_unswapped = detect_once
    sys.exit(run_node(sys.argv[1:]))
