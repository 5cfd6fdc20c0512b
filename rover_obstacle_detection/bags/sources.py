"""Open the files of a recording."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rosbags.convert.converter import migrate_bytes
from rosbags.highlevel import AnyReader

from rover_obstacle_detection.bags.decompression import (
    TooLargeError,
    bound_rosbags,
    decompress_file,
)
from rover_obstacle_detection.bags.image_folders import ImageFolders
from rover_obstacle_detection.bags.image_layouts import IMAGE_SUFFIXES, LAYOUTS
from rover_obstacle_detection.bags.message_types import guard_rosbags
from rover_obstacle_detection.bags.source import Entry, Source, choose_typestore
from rover_obstacle_detection.bags.streamed_mcap import StreamedMcap
from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.messages.rosbags_factory import ros1_typestore, ros2_typestore

bound_rosbags()
guard_rosbags()

SUFFIXES = ('.mcap', '.db3', '.bag')
# Of whole files compressed by `ros2 bag record --compression-mode file`.
COMPRESSED = '.zstd'


class RosbagsSource:
    """A recording read with the rosbags library; see `Source`.

    Parameters
    ----------
    path : Path
    stack : ExitStack
        Closes the recording.
    """

    def __init__(self, path: Path, stack: ExitStack) -> None:
        self._standard = ros1_typestore() if path.suffix == '.bag' else ros2_typestore()
        self._reader = stack.enter_context(AnyReader([path], default_typestore=self._standard))
        for each in self._reader.connections:
            # A damaged database can have anything in the columns of the topics.
            if not (isinstance(each.topic, str) and isinstance(each.msgtype, str)):
                raise ValueError(f'topic {each.topic!r} of type {each.msgtype!r}: expected names')
        self._migrations: dict[str, object] = {}
        self.note = ''
        self.topics: Mapping[str, str] = {
            each.topic: each.msgtype for each in self._reader.connections
        }
        self.span_ns: tuple[int, int] | None = None
        if self._reader.message_count:
            self.span_ns = self._reader.start_time, self._reader.end_time

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic."""
        return sum(each.msgcount for each in self._reader.connections if each.topic == topic)

    def messages(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> Iterator[Entry]:
        """Yield messages in time order."""
        connections = [each for each in self._reader.connections if each.topic in topics]
        # rosbags takes an empty list to mean every topic.
        if connections:
            for connection, log_time_ns, data in self._reader.messages(
                connections, start_ns, end_ns
            ):
                yield Entry(connection.topic, log_time_ns, connection.msgtype, data, self)

    def deserialize(self, entry: Entry) -> Any:
        """Decode an entry into a message object."""
        typestore = choose_typestore(entry.type_name, self._reader.typestore, self._standard)
        if self._reader.is2:
            return typestore.deserialize_cdr(entry.data, entry.type_name)
        return typestore.deserialize_ros1(entry.data, entry.type_name)

    def serialized(self, entry: Entry) -> bytes | memoryview:
        """Return an entry in ROS 2 wire format (CDR)."""
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


def open_sources(path: Path, stack: ExitStack) -> list[Source]:
    """Open the files of a recording.

    Parameters
    ----------
    path : Path
        Folder or file.
    stack : ExitStack
        Closes the files.

    Raises
    ------
    BagError
        If it cannot be read; one line that names the path.
    """
    if not path.exists():
        raise BagError(f'{path}: no such recording')
    if not path.is_dir():
        return [_open_file(path, stack)]
    files = _recordings_in(path)
    if (path / 'metadata.yaml').exists():
        try:
            return [RosbagsSource(path, stack)]
        except Exception as error:
            if not files or isinstance(error, TooLargeError):
                raise read_failure(path, error) from error
    if not files:
        if images := ImageFolders.find(path):
            return [images]
        raise BagError(
            f'{path}: is not a recording: the folder has no metadata.yaml, no '
            f'{", ".join(SUFFIXES)} file and no images of a known layout: {LAYOUTS}'
        )
    return [_open_file(each, stack) for each in files]


def read_failure(path: Path, error: Exception | str) -> BagError:
    """Return a one-line error for a recording that cannot be read."""
    if isinstance(error, BagError):
        return error
    if isinstance(error, TooLargeError):
        return BagError(f'{path}: {error}')
    if isinstance(error, PermissionError):
        return BagError(f'{path}: cannot be read: {error.strerror}')
    reason = ' '.join(str(error).split()) or type(error).__name__
    return BagError(f'{path}: cannot be read; is it cut short or damaged? ({reason})')


def plain_name(path: Path) -> str:
    """Return the name of a file of a recording without the suffix of compression."""
    return path.name.removesuffix(COMPRESSED)


def _recordings_in(folder: Path) -> list[Path]:
    """List the files of a recording; of a file and its compressed form only the file."""
    files = [
        each
        for each in folder.iterdir()
        if Path(plain_name(each)).suffix in SUFFIXES and not _is_special(each)
    ]
    return sorted(
        each
        for each in files
        if each.name == plain_name(each) or folder / plain_name(each) not in files
    )


def _is_special(path: Path) -> bool:
    """Whether opening a path may wait forever, or reading it never end."""
    return path.exists() and not (path.is_file() or path.is_dir())


def _open_file(path: Path, stack: ExitStack) -> Source:
    if Path(plain_name(path)).suffix not in SUFFIXES:
        what = 'an image' if path.suffix.lower() in IMAGE_SUFFIXES else 'not a recording'
        raise BagError(
            f'{path}: is {what}: expected a rosbag2 folder, a {", ".join(SUFFIXES)} file or a '
            'folder of images; for two image files, there is rover-obstacles detect'
        )
    if _is_special(path):
        raise BagError(f'{path}: is no file, but a pipe or a device')
    if path.stat().st_size == 0:
        raise BagError(f'{path}: is empty (0 bytes): expected a recording')
    if path.suffix == COMPRESSED:
        return _open_compressed(path, stack)
    try:
        return RosbagsSource(path, stack)
    except Exception as error:
        if path.suffix != '.mcap' or isinstance(error, (BagError, PermissionError, TooLargeError)):
            raise read_failure(path, error) from error
    source = StreamedMcap(path)
    if source.span_ns is None and source.failure:
        raise read_failure(path, source.failure)
    return source


def _open_compressed(path: Path, stack: ExitStack) -> Source:
    """Open a file that is compressed as a whole, from a folder for temporary files."""
    try:
        plain = Path(stack.enter_context(TemporaryDirectory())) / plain_name(path)
        cut_short = _decompress(path, plain)
    except OSError as error:
        raise BagError(f'{path}: cannot be decompressed: {error.strerror or error}') from error
    except Exception as error:
        raise read_failure(path, error) from error
    try:
        source = _open_file(plain, stack)
    except BagError as error:
        raise BagError(str(error).replace(str(plain), str(path))) from error
    source.note = source.note.replace(str(plain), str(path))
    if cut_short and not source.note:
        source.note = f'{path}: cut short ({cut_short}); what precedes can be read'
    return source


def _decompress(path: Path, plain: Path) -> str:
    """Decompress a file; return why it ends early if what precedes can be read, or nothing."""
    try:
        decompress_file(path, plain)
    except EOFError as error:
        if plain.suffix != '.mcap' or not plain.stat().st_size:
            raise
        return str(error)
    return ''
