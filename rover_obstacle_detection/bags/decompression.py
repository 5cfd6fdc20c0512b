"""Decompress what recordings hold, up to a limit: a few kilobytes can stand for gigabytes."""

from __future__ import annotations

import bz2
import dataclasses
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO, cast

import lz4.frame
from mcap.records import Chunk
from rosbags.rosbag1 import reader as rosbag1_reader
from rosbags.rosbag2 import reader as rosbag2_reader
from rosbags.rosbag2 import storage_mcap

MAX_BYTES = 256_000_000
"""Largest chunk or message after decompression."""

MAX_FILE_RATIO = 1000
"""Largest ratio of a file to its compressed form, if the file has more than `MAX_BYTES`."""

_PIECE_BYTES = 1_000_000

# The module that rosbags itself uses: Python's own from 3.14 on.
_zstd = cast(Any, rosbag2_reader).zstd


class TooLargeError(Exception):
    """Data beyond the limits of this module."""


def decompress_zstd(data: bytes) -> bytes:
    """Decompress one or more zstd frames of at most `MAX_BYTES`."""
    _check_size(_zstd.get_frame_info(data).decompressed_size)
    return _decompress(_zstd.ZstdDecompressor, data)


def decompress_lz4(data: bytes) -> bytes:
    """Decompress one or more lz4 frames of at most `MAX_BYTES`."""
    _check_size(lz4.frame.get_frame_info(data)['content_size'])
    return _decompress(lz4.frame.LZ4FrameDecompressor, data)


def decompress_bz2(data: bytes) -> bytes:
    """Decompress one or more bz2 streams of at most `MAX_BYTES`."""
    return _decompress(bz2.BZ2Decompressor, data)


def decompressed_chunk(chunk: Chunk) -> Chunk:
    """Return an mcap chunk with its records in plain form."""
    decompress = {'zstd': decompress_zstd, 'lz4': decompress_lz4}.get(chunk.compression)
    if decompress is None:
        return chunk
    return dataclasses.replace(chunk, compression='', data=decompress(chunk.data))


def bound_rosbags() -> None:
    """Have the rosbags library decompress with the functions of this module."""
    storage_mcap.DECOMPRESSORS['zstd'] = lambda data, _: decompress_zstd(data)
    storage_mcap.DECOMPRESSORS['lz4'] = lambda data, _: decompress_lz4(data)
    rosbag1_reader.decompressors['lz4'] = decompress_lz4
    rosbag1_reader.decompressors['bz2'] = decompress_bz2
    cast(Any, rosbag2_reader).zstd = SimpleNamespace(decompress=decompress_zstd, open=_open_zstd)


def decompress_file(path: Path, plain: Path) -> None:
    """Decompress a zstd file of a recording into another file.

    Raises
    ------
    TooLargeError
        If it has more than the limit.
    EOFError
        If it is cut short; the other file has what precedes.
    OSError
        If one of the files cannot be opened, read or written.
    Exception
        Whatever the library raises if it is damaged.
    """
    with path.open('rb') as file, plain.open('wb') as out, _open_zstd(file, 'rb') as data:
        while piece := data.read(_PIECE_BYTES):
            out.write(piece)


class _BoundedFile:
    """A compressed file of which only so much can be read."""

    def __init__(self, file: Any, limit: int) -> None:
        self._file = file
        self._left = limit
        self._limit = limit

    def __enter__(self) -> _BoundedFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def read(self, size: int) -> bytes:
        # Unlike read, this returns what precedes the end of a file that is cut short.
        data: bytes = self._file.read1(size)
        self._left -= len(data)
        if self._left < 0:
            raise TooLargeError(
                f'the file has more than {self._limit} bytes after decompression: expected at '
                f'most {MAX_FILE_RATIO} times its size, and half of the free disk space'
            )
        return data


def _open_zstd(file: BinaryIO, mode: str) -> _BoundedFile:
    compressed = os.fstat(file.fileno()).st_size
    # rosbags decompresses files into the folder for temporary files.
    free = shutil.disk_usage(tempfile.gettempdir()).free
    limit = min(max(MAX_BYTES, MAX_FILE_RATIO * compressed), free // 2)
    return _BoundedFile(_zstd.open(file, mode), limit)


def _decompress(start: Callable[[], Any], data: bytes) -> bytes:
    pieces: list[bytes] = []
    size = 0
    while data:
        decompressor = start()
        while not decompressor.eof:
            piece = decompressor.decompress(data, max_length=_PIECE_BYTES)
            data = b''
            if not piece and decompressor.needs_input:
                raise EOFError('compressed data is cut short')
            size += len(piece)
            _check_size(size)
            pieces.append(piece)
        data = decompressor.unused_data or b''
    return b''.join(pieces)


def _check_size(size: int | None) -> None:
    if size is not None and size > MAX_BYTES:
        raise TooLargeError(
            f'a chunk or message has {size} bytes or more after decompression: expected at most '
            f'{MAX_BYTES}'
        )
