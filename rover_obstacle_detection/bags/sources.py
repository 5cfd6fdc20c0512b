"""The files that a recording consists of, each behind the same face."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from rosbags.convert.converter import migrate_bytes
from rosbags.highlevel import AnyReader
from rosbags.typesys.store import Typestore

from rover_obstacle_detection.bags.topics import COMPRESSED_TYPE, IMAGE_TYPE, INFO_TYPE
from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.messages.rosbags_factory import ros1_typestore, ros2_typestore

_UNCHANGED = frozenset({IMAGE_TYPE, COMPRESSED_TYPE, INFO_TYPE})

SUFFIXES = ('.mcap', '.db3', '.bag')


class Entry(NamedTuple):
    """A message as it lies in the recording."""

    topic: str
    log_time_ns: int
    type_name: str
    data: bytes
    source: Source


class Source(Protocol):
    """One readable part of a recording."""

    topics: Mapping[str, str]
    span_ns: tuple[int, int] | None
    note: str

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic."""
        ...

    def messages(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> Iterator[Entry]:
        """Read messages in the order of their times."""
        ...

    def deserialize(self, entry: Entry) -> Any:
        """Make the message of an entry."""
        ...

    def serialized(self, entry: Entry) -> bytes | memoryview:
        """Give the message of an entry as ROS 2 sends it (CDR)."""
        ...


class RosbagsSource:
    """A recording that the rosbags library reads.

    Parameters
    ----------
    path : Path
    stack : ExitStack
        Closes it.
    """

    def __init__(self, path: Path, stack: ExitStack) -> None:
        known = ros1_typestore() if path.suffix == '.bag' else ros2_typestore()
        self._reader = stack.enter_context(AnyReader([path], default_typestore=known))
        self._migrations: dict[str, object] = {}
        self.note = ''
        self.topics: Mapping[str, str] = {
            each.topic: each.msgtype for each in self._reader.connections
        }
        self.span_ns: tuple[int, int] | None = None
        if self._reader.message_count:
            self.span_ns = self._reader.start_time, self._reader.end_time
        self._known = known

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic."""
        return sum(each.msgcount for each in self._reader.connections if each.topic == topic)

    def messages(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> Iterator[Entry]:
        """Read messages in the order of their times."""
        connections = [each for each in self._reader.connections if each.topic in topics]
        # An empty filter would mean every topic.
        if connections:
            for connection, log_time_ns, data in self._reader.messages(
                connections, start_ns, end_ns
            ):
                yield Entry(connection.topic, log_time_ns, connection.msgtype, data, self)

    def deserialize(self, entry: Entry) -> Any:
        """Make the message of an entry."""
        typestore = choose_typestore(entry.type_name, self._reader.typestore, self._known)
        if self._reader.is2:
            return typestore.deserialize_cdr(entry.data, entry.type_name)
        return typestore.deserialize_ros1(entry.data, entry.type_name)

    def serialized(self, entry: Entry) -> bytes | memoryview:
        """Give the message of an entry as ROS 2 sends it (CDR)."""
        if self._reader.is2:
            return entry.data
        return migrate_bytes(
            self._reader.typestore,
            ros2_typestore(),
            entry.type_name,
            entry.type_name,
            self._migrations,
            entry.data,
            src_is2=False,
            dst_is2=True,
        )


def choose_typestore(type_name: str, recorded: Typestore, known: Typestore) -> Typestore:
    """Choose whose definition of a type to go by, the recording's own or the standard one.

    Recordings need not define every type, old ones define none; and of the types that have never
    changed, a damaged definition must not be taken for a new one.
    """
    return known if type_name in _UNCHANGED or type_name not in recorded.fielddefs else recorded


def open_sources(path: Path, stack: ExitStack) -> list[Source]:
    """Open the files of a recording.

    Parameters
    ----------
    path : Path
        Folder or file.
    stack : ExitStack
        Closes them.

    Raises
    ------
    BagError
        One line that names the path.
    """
    if not path.exists():
        msg = f'{path}: no such recording'
        raise BagError(msg)
    if not path.is_dir():
        return [_open_file(path, stack)]
    files = sorted(each for each in path.iterdir() if each.suffix in SUFFIXES)
    if (path / 'metadata.yaml').exists():
        try:
            return [RosbagsSource(path, stack)]
        except Exception as error:
            if not files:
                raise read_failure(path, error) from error
    if not files:
        msg = (
            f'{path}: is not a recording: the folder has no metadata.yaml and no '
            f'{", ".join(SUFFIXES)} file'
        )
        raise BagError(msg)
    return [_open_file(each, stack) for each in files]


def read_failure(path: Path, error: Exception | str) -> BagError:
    """Say in one line that a recording cannot be read."""
    if isinstance(error, BagError):
        return error
    if isinstance(error, PermissionError):
        return BagError(f'{path}: cannot be read: {error.strerror}')
    reason = ' '.join(str(error).split()) or type(error).__name__
    return BagError(f'{path}: cannot be read, is it cut short or damaged? ({reason})')


def _open_file(path: Path, stack: ExitStack) -> Source:
    if path.suffix not in SUFFIXES:
        msg = (
            f'{path}: is not a recording: expected a rosbag2 folder, or a file '
            f'{", ".join(SUFFIXES)}'
        )
        raise BagError(msg)
    try:
        if path.stat().st_size == 0:
            msg = f'{path}: is empty (0 bytes): expected a recording'
            raise BagError(msg)
        return RosbagsSource(path, stack)
    except Exception as error:
        if path.suffix != '.mcap' or isinstance(error, (BagError, PermissionError)):
            raise read_failure(path, error) from error
    from rover_obstacle_detection.bags.streamed_mcap import StreamedMcap

    source = StreamedMcap(path)
    if source.span_ns is None and source.failure:
        raise read_failure(path, source.failure)
    return source
