"""Read and make ``std_msgs/Header``."""

from __future__ import annotations

from typing import Any

from rover_obstacle_detection.messages.factory import MessageFactory

NANOSECONDS_PER_SECOND = 1_000_000_000


def stamp_ns(header: Any) -> int:
    """Return the stamp of a ``std_msgs/Header`` (ns)."""
    stamp = header.stamp
    return int(stamp.sec) * NANOSECONDS_PER_SECOND + int(stamp.nanosec)


def make_header(stamp_ns: int, frame_id: str, factory: MessageFactory) -> Any:
    """Make a ``std_msgs/Header``."""
    sec, nanosec = divmod(int(stamp_ns), NANOSECONDS_PER_SECOND)
    stamp = factory.make('builtin_interfaces/msg/Time', sec=sec, nanosec=nanosec)
    return factory.make('std_msgs/msg/Header', stamp=stamp, frame_id=frame_id)
