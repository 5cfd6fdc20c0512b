"""The metadata of an ONNX file, which OpenCV does not give."""

from __future__ import annotations

from collections.abc import Iterator

_METADATA_PROPS, _KEY, _VALUE = 14, 1, 2
"""Field numbers of ``ModelProto`` and ``StringStringEntryProto`` in onnx.proto."""

_VARINT, _FIXED64, _LENGTH_DELIMITED, _FIXED32 = 0, 1, 2, 5


def read_metadata(model: bytes) -> dict[str, str]:
    """Read the ``metadata_props`` of a serialised ``ModelProto``.

    Parameters
    ----------
    model : bytes

    Raises
    ------
    ValueError
        If the bytes are not a serialised message.
    """
    entries = (content for number, content in _fields(model) if number == _METADATA_PROPS)
    pairs = (dict(_fields(entry)) for entry in entries)
    return {pair.get(_KEY, b'').decode(): pair.get(_VALUE, b'').decode() for pair in pairs}


def _fields(message: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield number and content of each length-delimited field of a Protocol Buffers message."""
    position = 0
    while position < len(message):
        tag, position = _varint(message, position)
        kind = tag & 7
        if kind == _LENGTH_DELIMITED:
            length, position = _varint(message, position)
            yield tag >> 3, message[position : position + length]
            position += length
        elif kind == _VARINT:
            _, position = _varint(message, position)
        elif kind in (_FIXED32, _FIXED64):
            position += 4 if kind == _FIXED32 else 8
        else:
            msg = f'unknown wire type {kind}: expected a serialised ONNX model'
            raise ValueError(msg)


def _varint(message: bytes, position: int) -> tuple[int, int]:
    value = shift = 0
    while position < len(message):
        byte = message[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, position
        shift += 7
    msg = 'the message ends within a number: expected a serialised ONNX model'
    raise ValueError(msg)
