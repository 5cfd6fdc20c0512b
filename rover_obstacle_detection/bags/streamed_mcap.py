"""Mcap files read from the beginning, without the index at their end.

A loss of power leaves them without it, and some recorders do not write ROS's profile.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from rover_obstacle_detection.bags.sources import Entry, choose_typestore
from rover_obstacle_detection.messages.rosbags_factory import ros2_typestore

_ROS_ENCODING = 'cdr'


class StreamedMcap:
    """The messages of an mcap file that come before its first unreadable record.

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
        """What is wrong with the first unreadable record; empty if all can be read."""
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
                f'{path}: cut short or damaged ({self.failure}): read as far as it goes, '
                f'{self._counts.total()} messages'
            )

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic."""
        return self._counts[topic]

    def messages(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> Iterator[Entry]:
        """Read messages in the order of the file, which recorders write as they come."""
        for topic, type_name, message in self._read():
            time_ns = message.log_time
            if (
                topic in topics
                and (start_ns is None or time_ns >= start_ns)
                and (end_ns is None or time_ns < end_ns)
            ):
                yield Entry(topic, time_ns, type_name, message.data, self)

    def deserialize(self, entry: Entry) -> Any:
        """Make the message of an entry."""
        typestore = choose_typestore(entry.type_name, self._typestore, ros2_typestore())
        return typestore.deserialize_cdr(entry.data, entry.type_name)

    def serialized(self, entry: Entry) -> bytes:
        """Give the message of an entry as ROS 2 sends it (CDR)."""
        return entry.data

    def _scan(self) -> None:
        for topic, _, message in self._read():
            self._counts[topic] += 1
            start_ns, end_ns = self.span_ns or (message.log_time, message.log_time + 1)
            self.span_ns = min(start_ns, message.log_time), max(end_ns, message.log_time + 1)

    def _read(self) -> Iterator[tuple[str, str, Message]]:
        with self._path.open('rb') as file:
            # A damaged length must not make it ask for more memory than the file has bytes.
            limit = self._path.stat().st_size
            records = StreamReader(file, record_size_limit=limit).records
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
            try:
                types = get_types_from_msg(schema.data.decode(), schema.name)
            except (TypesysError, UnicodeDecodeError):
                # Its messages, should anyone ask for them, are bad ones; the others are not.
                continue
            known = self._typestore.fielddefs
            self._typestore.register({name: types[name] for name in types.keys() - known.keys()})
