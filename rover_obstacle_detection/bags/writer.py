"""Write rosbag2 recordings (mcap) atomically."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError

from rover_obstacle_detection.errors import OutputError
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory
from rover_obstacle_detection.partial_folder import partial_folder


class BagWriter:
    """Writes a rosbag2 folder with one mcap file, including the message definitions.

    Use it as a context manager. The recording is written to a temporary folder next to `path`
    and renamed when the block ends. An exception discards it.

    Parameters
    ----------
    path : str or Path
        The folder to create.
    compress : bool
        Compress with zstd, at about 60 MB/s. Masks and labels shrink a hundredfold, camera images
        and clouds by a third.

    Raises
    ------
    OutputError
        If `path` exists, cannot be written, or another process writes it.
    """

    def __init__(self, path: str | Path, *, compress: bool = True) -> None:
        self.path = Path(path)
        self.compress = compress
        self.factory = RosbagsFactory()
        self._connections: dict[tuple[str, str], Connection] = {}
        self._stack = ExitStack()
        self._partial = self.path
        self._writer: Writer | None = None

    def __enter__(self) -> BagWriter:
        if self.path.exists():
            raise OutputError(f'{self.path}: already exists: expected a new folder')
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            partial = self._stack.enter_context(partial_folder(self.path))
            # rosbags names the files after the folder, so the inner folder has the final name.
            self._partial = partial / self.path.name
            self._writer = Writer(
                self._partial,
                version=9,
                storage_plugin=StoragePlugin.MCAP,
            )
            if self.compress:
                self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except (OSError, WriterError) as error:
            self._stack.close()
            raise self._failure(error) from error
        return self

    def add(self, topic: str, type_name: str, message: Any, stamp_ns: int) -> None:
        """Write a message made by `factory` or read by rosbags.

        Parameters
        ----------
        topic : str
        type_name : str
            For example ``sensor_msgs/msg/Image``.
        message
        stamp_ns : int
            Log time of the message.

        Raises
        ------
        OutputError
            If the message cannot be written.
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
        try:
            if exc_type is None:
                self._writer.close()
                self._partial.rename(self.path)
            else:
                self._writer.abort()
        except OSError as error:
            raise self._failure(error) from error
        finally:
            self._stack.close()

    def _failure(self, error: Exception) -> OutputError:
        reason = getattr(error, 'strerror', None) or str(error)
        return OutputError(f'{self.path}: cannot be written: {reason}')
