"""Parse a recording's message definitions, and refuse names that are no names.

rosbags writes Python code with the names of a definition and runs it: a name like 2d breaks it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

from rosbags.highlevel import anyreader
from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError, get_types_from_msg

Types = dict[str, Any]

_TYPE_NAME = re.compile(r'[a-zA-Z]\w*(/[a-zA-Z]\w*){1,2}', re.ASCII)
_MEMBER_NAME = re.compile(r'[a-zA-Z_]\w*', re.ASCII)


def types_from_msg(text: str, name: str) -> Types:
    """Parse a definition in ROS's msg format.

    Parameters
    ----------
    text : str
        The definition, and those of the types that it uses.
    name : str
        For example ``sensor_msgs/msg/Image``.

    Raises
    ------
    TypesysError
        If it cannot be parsed, or a type, field or constant has an invalid name.
    """
    types: Types = dict(get_types_from_msg(text, name))
    _check(types)
    return types


def guard_rosbags() -> None:
    """Have the rosbags library check names too."""

    def checked(parse: Callable[..., Any]) -> Callable[..., Types]:
        def parse_and_check(*definition: str) -> Types:
            types: Types = dict(parse(*definition))
            _check(types)
            return types

        return parse_and_check

    for name in ('get_types_from_msg', 'get_types_from_idl'):
        setattr(anyreader, name, checked(getattr(anyreader, name)))


def _check(types: Types) -> None:
    for type_name, (constants, fields) in types.items():
        for each in (type_name, *_referred(fields)):
            if not _TYPE_NAME.fullmatch(each):
                raise TypesysError(f'{each!r} is not the name of a message type')
        for each in (member[0] for member in (*constants, *fields)):
            if not _MEMBER_NAME.fullmatch(each):
                raise TypesysError(f'{type_name}: {each!r} is not the name of a field')


def _referred(fields: Any) -> Iterator[str]:
    """Yield the names of the types of fields."""
    for _, (kind, content) in fields:
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            kind, content = content[0]
        if kind == Nodetype.NAME:
            yield content
