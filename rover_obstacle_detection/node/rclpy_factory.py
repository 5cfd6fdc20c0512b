"""Messages of rclpy: what the node publishes."""

from __future__ import annotations

import importlib
from array import array
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

# What the generated classes keep their sequences in, by NumPy kind and size.
_TYPECODES = {
    'u1': 'B', 'i1': 'b', 'u2': 'H', 'i2': 'h', 'u4': 'I', 'i4': 'i', 'u8': 'Q', 'i8': 'q',
    'f4': 'f', 'f8': 'd',
}  # fmt: skip


class RclpyFactory:
    """Makes messages of the installed ROS distribution; see `MessageFactory`."""

    def make(self, type_name: str, **fields: Any) -> Any:
        """Make a message; see `MessageFactory.make`."""
        message = message_type(type_name)()
        for name, value in fields.items():
            setattr(message, name, _native(value))
        return message


@lru_cache(maxsize=64)
def message_type(type_name: str) -> Any:
    """Find the class of a type such as ``sensor_msgs/msg/Image``.

    Raises
    ------
    ImportError
        If its package is not installed or has no such message.
    """
    package, _, name = type_name.partition('/')
    name = name.rpartition('/')[2]
    module = importlib.import_module(f'{package}.msg')
    try:
        return getattr(module, name)
    except AttributeError as error:
        msg = f'{package} has no message {name}'
        raise ImportError(msg) from error


def _native(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return _sequence(value)
    # rclpy takes NumPy numbers, and fails when the message is published.
    return value.item() if isinstance(value, np.generic) else value


def _sequence(values: NDArray[Any]) -> array[Any]:
    # An ndarray assigned as it is would be checked and copied number by number (45 ms an image).
    sequence = array(_TYPECODES[values.dtype.str[1:]])
    sequence.frombytes(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)
    return sequence
