"""The interface of one file of a recording, and the choice of message definitions."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, NamedTuple, Protocol

from rosbags.typesys.store import Typestore

from rover_obstacle_detection.bags.topics import COMPRESSED_TYPE, IMAGE_TYPE, INFO_TYPE

# Their definitions are the same in every ROS release.
_UNCHANGED = frozenset({IMAGE_TYPE, COMPRESSED_TYPE, INFO_TYPE})


class Entry(NamedTuple):
    """A serialized message and the source that can decode it."""

    topic: str
    log_time_ns: int
    type_name: str
    data: bytes
    source: Source


class Source(Protocol):
    """A readable part of a recording.

    Attributes
    ----------
    topics : mapping of str to str
        Message type of each topic.
    span_ns : tuple of int or None
        Time of the first message, and 1 ns after the last; None if there are no messages.
    note : str
        Damage found while reading; empty if there is none.
    """

    topics: Mapping[str, str]
    span_ns: tuple[int, int] | None
    note: str

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic."""
        ...

    def messages(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> Iterator[Entry]:
        """Yield messages in time order, from `start_ns` up to but excluding `end_ns`."""
        ...

    def deserialize(self, entry: Entry) -> Any:
        """Decode an entry into a message object."""
        ...

    def serialized(self, entry: Entry) -> bytes | memoryview:
        """Return an entry in ROS 2 wire format (CDR)."""
        ...


def choose_typestore(type_name: str, recorded: Typestore, standard: Typestore) -> Typestore:
    """Choose between a recording's own definition of a type and the standard one.

    The recording's definition wins if it has one. The image and calibration types never changed,
    so there a recorded definition that differs is damaged, and the standard one is used.
    """
    use_recorded = type_name in recorded.fielddefs and type_name not in _UNCHANGED
    return recorded if use_recorded else standard
