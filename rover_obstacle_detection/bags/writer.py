"""Writing rosbag2 recordings (mcap): whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory


class BagWriter:
    """Writes a rosbag2 folder with one mcap file and its type definitions.

    A context manager: the recording is written beside `path` and takes its name when the block
    ends well; when it ends in an exception, nothing of it stays.

    Parameters
    ----------
    path : str or Path
        The folder to make.
    compress : bool
        With zstd. Masks and labels shrink a hundredfold, camera images and clouds by a third,
        at some 60 MB/s.

    Raises
    ------
    OutputError
        If `path` exists or cannot be written.
    """

    def __init__(self, path: str | Path, *, compress: bool = True) -> None:
        self.path = Path(path)
        self.compress = compress
        self.factory = RosbagsFactory()
        self._connections: dict[tuple[str, str], Connection] = {}
        self._partial: Path | None = None
        self._writer: Writer | None = None

    def __enter__(self) -> BagWriter:
        if self.path.exists():
            msg = f'{self.path} exists already: expected the name of a new recording'
            raise OutputError(msg)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._partial = Path(
                tempfile.mkdtemp(prefix=f'.{self.path.name}-', dir=self.path.parent)
            )
            # The folder within has the final name, which the files in it are called after.
            self._writer = Writer(
                self._partial / self.path.name,
                version=9,
                storage_plugin=StoragePlugin.MCAP,
            )
            if self.compress:
                self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except (OSError, WriterError) as error:
            self._discard()
            raise self._failure(error) from error
        return self

    def add(self, topic: str, type_name: str, message: Any, stamp_ns: int) -> None:
        """Add a message that `factory` made, or rosbags read.

        Parameters
        ----------
        topic : str
        type_name : str
            Such as ``sensor_msgs/msg/Image``.
        message
        stamp_ns : int
            Time of the message in the recording.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        assert self._writer is not None
        typestore = self.factory.typestore
        connection = self._connections.get((topic, type_name))
        if connection is None:
            connection = self._writer.add_connection(topic, type_name, typestore=typestore)
            self._connections[topic, type_name] = connection
        data = typestore.serialize_cdr(message, type_name)
        try:
            self._writer.write(connection, stamp_ns, data)
        except OSError as error:
            raise self._failure(error) from error

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        assert self._writer is not None
        assert self._partial is not None
        try:
            if exc_type is None:
                self._writer.close()
                (self._partial / self.path.name).rename(self.path)
            else:
                self._writer.abort()
        except OSError as error:
            raise self._failure(error) from error
        finally:
            self._discard()

    def _discard(self) -> None:
        if self._partial is not None:
            shutil.rmtree(self._partial, ignore_errors=True)

    def _failure(self, error: Exception) -> OutputError:
        reason = getattr(error, 'strerror', None) or str(error)
        return OutputError(f'{self.path}: cannot be written: {reason}')
