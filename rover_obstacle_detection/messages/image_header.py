"""Size of a compressed image from its header, before a decoder allocates memory for it."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

Size = tuple[int, int]

_PNM = re.compile(rb'P[1-6](?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s')
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_TIFF_SIZES = {256: 0, 257: 1}
_TIFF_FORMATS = {3: 'H', 4: 'I'}


def declared_size(data: bytes) -> Size:
    """Read width and height of a JPEG, PNG, PNM, BMP or TIFF file.

    Parameters
    ----------
    data : bytes
        The whole file.

    Returns
    -------
    width, height : int
        Pixels.

    Raises
    ------
    ValueError
        If it is none of these formats, or declares more than it contains.
    """
    for magic, read in _READERS.items():
        if data.startswith(magic):
            try:
                return read(data)
            except struct.error:
                break
    raise ValueError('expected a JPEG, PNG, PNM, BMP or TIFF file')


def _png(data: bytes) -> Size:
    # OpenCV allocates the declared length of a chunk before it reads one.
    position = 8
    while position < len(data):
        length, kind = struct.unpack_from('>I4s', data, position)
        if length > len(data) - position - 12:
            raise ValueError(f'PNG chunk {kind!r} has a length of {length} bytes: file too short')
        position += 12 + length
        if kind == b'IEND':
            break
    width, height = struct.unpack_from('>II', data, 16)
    return width, height


def _jpeg(data: bytes) -> Size:
    position = 2
    while True:
        marker, kind, length = struct.unpack_from('>BBH', data, position)
        if marker != 0xFF:
            raise ValueError('JPEG segments are damaged')
        if kind in _JPEG_FRAMES:
            height, width = struct.unpack_from('>HH', data, position + 5)
            return width, height
        # 0xFF may be repeated before a marker.
        position += 1 if kind == 0xFF else 2 + length


def _pnm(data: bytes) -> Size:
    found = _PNM.match(data)
    if found is None:
        raise ValueError('PNM header is damaged')
    return int(found[1]), int(found[2])


def _bmp(data: bytes) -> Size:
    width, height = struct.unpack_from('<ii', data, 18)
    return abs(width), abs(height)


def _tiff(data: bytes) -> Size:
    order = '<' if data.startswith(b'II') else '>'
    (start,) = struct.unpack_from(order + 'I', data, 4)
    (count,) = struct.unpack_from(order + 'H', data, start)
    size = [0, 0]
    for entry in range(start + 2, start + 2 + 12 * count, 12):
        tag, kind = struct.unpack_from(order + 'HH', data, entry)
        if tag in _TIFF_SIZES and kind in _TIFF_FORMATS:
            (size[_TIFF_SIZES[tag]],) = struct.unpack_from(
                order + _TIFF_FORMATS[kind], data, entry + 8
            )
    return size[0], size[1]


_READERS: dict[bytes, Callable[[bytes], Size]] = {
    b'\xff\xd8\xff': _jpeg,
    b'\x89PNG\r\n\x1a\n': _png,
    b'BM': _bmp,
    b'II*\0': _tiff,
    b'MM\0*': _tiff,
    b'P': _pnm,
}
