"""Messages of the rosbags library: what a recording is read from and written to."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore


@lru_cache(maxsize=1)
def ros2_typestore() -> Typestore:
    """Message types of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


@lru_cache(maxsize=1)
def ros1_typestore() -> Typestore:
    """Message types of ROS 1 Noetic."""
    return get_typestore(Stores.ROS1_NOETIC)


class RosbagsFactory:
    """Makes messages of a rosbags typestore; what is not given is zero or empty.

    Other defaults of ROS, such as a quaternion's w of 1, are not applied: give them.

    Parameters
    ----------
    typestore : Typestore, optional
        ROS 2 Jazzy's if none is given.
    """

    def __init__(self, typestore: Typestore | None = None) -> None:
        self.typestore = typestore or ros2_typestore()

    def make(self, type_name: str, **fields: Any) -> Any:
        """Make a message; see `MessageFactory.make`."""
        _, definitions = self.typestore.fielddefs[type_name]
        unknown = fields.keys() - {name for name, _ in definitions}
        if unknown:
            msg = f'{type_name} has no field {sorted(unknown)[0]!r}'
            raise TypeError(msg)
        values = {
            name: fields[name] if name in fields else self._default(field)
            for name, field in definitions
        }
        return self.typestore.types[type_name](**values)

    def _default(self, field: Any) -> Any:
        kind, detail = field
        if kind == Nodetype.BASE:
            return _ZEROS.get(detail[0], 0)
        if kind == Nodetype.NAME:
            return self.make(detail)
        (element_kind, element), length = detail
        if kind == Nodetype.SEQUENCE:
            length = 0
        if element_kind == Nodetype.BASE and element[0] != 'string':
            return np.zeros(length, _DTYPES.get(element[0], element[0]))
        return [self._default((element_kind, element)) for _ in range(length)]


_ZEROS: dict[str, bool | str | float] = {
    'bool': False,
    'string': '',
    'float32': 0.0,
    'float64': 0.0,
}
_DTYPES = {'octet': 'int8', 'byte': 'int8', 'char': 'uint8'}
