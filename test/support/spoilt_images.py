"""Ways to spoil an image message."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def set_field(name: str, value: object) -> Callable[[Any], None]:
    return lambda image: setattr(image, name, value)


def truncate(image: Any) -> None:
    image.data = image.data[:1000]


def shrink(image: Any) -> None:
    image.width, image.height, image.step = 160, 120, 160
    image.data = image.data[: 160 * 120]


def no_stamp(image: Any) -> None:
    image.header.stamp.sec = image.header.stamp.nanosec = 0
