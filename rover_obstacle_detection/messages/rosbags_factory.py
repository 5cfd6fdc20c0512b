"""Make messages of the rosbags library, which reads and writes recordings."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore


@lru_cache(maxsize=1)
def ros2_typestore() -> Typestore:
    """Return the message types of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


@lru_cache(maxsize=1)
def ros1_typestore() -> Typestore:
    """Return the message types of ROS 1 Noetic."""
    return get_typestore(Stores.ROS1_NOETIC)


class RosbagsFactory:
    """Makes messages of a rosbags typestore; fields not given are zero or empty.

    ROS defaults other than zero, such as 1 for a quaternion's w, must be given explicitly.

    Parameters
    ----------
    typestore : Typestore, optional
        Default: ROS 2 Jazzy.
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
