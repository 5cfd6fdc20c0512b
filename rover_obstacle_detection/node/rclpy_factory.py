"""Make messages of rclpy, which the node publishes."""

from __future__ import annotations

import importlib
from array import array
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

# array typecodes of rclpy's sequence fields, by NumPy kind and size.
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
    """Return the class of a type such as ``sensor_msgs/msg/Image``.

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
    # rclpy accepts NumPy numbers here, but then fails in publish().
    return value.item() if isinstance(value, np.generic) else value


def _sequence(values: NDArray[Any]) -> array[Any]:
    # rclpy would check and copy an ndarray element by element (tens of ms per image).
    sequence = array(_TYPECODES[values.dtype.str[1:]])
    sequence.frombytes(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)
    return sequence
