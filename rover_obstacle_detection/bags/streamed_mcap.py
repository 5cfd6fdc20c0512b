"""Read an mcap file from the start, without its index.

The index at the end is missing after a power loss. Some recorders omit the ROS profile, which the
rosbags library requires.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.typesys import Stores, TypesysError, get_typestore

from rover_obstacle_detection.bags.decompression import decompressed_chunk
from rover_obstacle_detection.bags.message_types import types_from_msg
from rover_obstacle_detection.bags.source import Entry, choose_typestore
from rover_obstacle_detection.messages.rosbags_factory import ros2_typestore
from rover_obstacle_detection.wording import counted

_ROS_ENCODING = 'cdr'


class StreamedMcap:
    """The messages of an mcap file before its first unreadable record; see `Source`.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: Counter[str] = Counter()
        self.span_ns: tuple[int, int] | None = None
        self.failure = ''
        """Error of the first unreadable record; empty if the file is intact."""
        self._scan()
        self._typestore = get_typestore(Stores.EMPTY)
        self._register_types()
        self.topics: Mapping[str, str] = {
            channel.topic: self._schemas[channel.schema_id].name
            for channel in self._channels.values()
        }
        self.note = ''
        if self.failure:
            self.note = (
                f'{path}: cut short or damaged ({self.failure}); '
                f'{counted(self._counts.total(), "message")} can be read'
            )

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic."""
        return self._counts[topic]

    def messages(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> Iterator[Entry]:
        """Yield messages in file order, which is the order of recording."""
        for topic, type_name, message in self._read():
            time_ns = message.log_time
            if (
                topic in topics
                and (start_ns is None or time_ns >= start_ns)
                and (end_ns is None or time_ns < end_ns)
            ):
                yield Entry(topic, time_ns, type_name, message.data, self)

    def deserialize(self, entry: Entry) -> Any:
        """Decode an entry into a message object."""
        typestore = choose_typestore(entry.type_name, self._typestore, ros2_typestore())
        return typestore.deserialize_cdr(entry.data, entry.type_name)

    def serialized(self, entry: Entry) -> bytes:
        """Return an entry in ROS 2 wire format (CDR)."""
        return entry.data

    def _scan(self) -> None:
        for topic, _, message in self._read():
            self._counts[topic] += 1
            start_ns, end_ns = self.span_ns or (message.log_time, message.log_time + 1)
            self.span_ns = min(start_ns, message.log_time), max(end_ns, message.log_time + 1)

    def _read(self) -> Iterator[tuple[str, str, Message]]:
        with self._path.open('rb') as file:
            # A damaged length field must not allocate more memory than the file size.
            limit = self._path.stat().st_size
            reader = StreamReader(file, emit_chunks=True, record_size_limit=limit)
            records = _in_chunks(reader.records)
            while True:
                try:
                    record = next(records, None)
                except Exception as error:
                    self.failure = ' '.join(str(error).split()) or type(error).__name__
                    return
                if record is None:
                    return
                if isinstance(record, Schema):
                    self._schemas[record.id] = record
                elif isinstance(record, Channel):
                    if (
                        record.message_encoding == _ROS_ENCODING
                        and record.schema_id in self._schemas
                    ):
                        self._channels[record.id] = record
                elif isinstance(record, Message) and record.channel_id in self._channels:
                    channel = self._channels[record.channel_id]
                    yield channel.topic, self._schemas[channel.schema_id].name, record

    def _register_types(self) -> None:
        for schema in self._schemas.values():
            if schema.encoding != 'ros2msg':
                continue
            known = self._typestore.fielddefs
            # Otherwise, only messages of this type become unreadable.
            with contextlib.suppress(TypesysError, UnicodeDecodeError):
                types = types_from_msg(schema.data.decode(), schema.name)
                new = {name: types[name] for name in types.keys() - known.keys()}
                self._typestore.register(new)


def _in_chunks(records: Iterable[McapRecord]) -> Iterator[McapRecord]:
    """Yield records, and instead of each chunk the records in it."""
    for record in records:
        if isinstance(record, Chunk):
            yield from breakup_chunk(decompressed_chunk(record))
        else:
            yield record
