"""Attach messages of other topics to the stereo pair with the same stamp."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Generic, TypeVar

from rover_obstacle_detection.messages.header import NANOSECONDS_PER_SECOND, stamp_ns

# How long a pair waits for its extra messages, in recording time.
_WAIT_NS = NANOSECONDS_PER_SECOND

Item = TypeVar('Item')


class Extras(Generic[Item]):
    """Holds each item until all its extra messages have arrived, for at most one second.

    Parameters
    ----------
    topics : sequence of str
        Extra topics; if empty, items are released at once.
    """

    def __init__(self, topics: Sequence[str]) -> None:
        self.topics = tuple(topics)
        self._messages: dict[str, dict[int, Any]] = {topic: {} for topic in topics}
        self._held: deque[tuple[int, int, Item]] = deque()

    def take(self, topic: str, message: Any) -> None:
        """Store a message of an extra topic."""
        waiting = self._messages[topic]
        waiting[stamp_ns(message.header)] = message
        oldest_ns = next(iter(waiting))
        # Messages whose pair never came, because an image was lost or skipped.
        if stamp_ns(message.header) - oldest_ns > 2 * _WAIT_NS:
            del waiting[oldest_ns]

    def hold(self, stamp_ns: int, log_time_ns: int, item: Item) -> None:
        """Queue an item until its messages have arrived."""
        self._held.append((stamp_ns, log_time_ns, item))

    def ready(self, log_time_ns: int | None) -> Iterator[tuple[Item, Mapping[str, Any]]]:
        """Yield, in order, the items that are complete or overdue; all of them if time is None."""
        while self._held:
            stamp, held_ns, item = self._held[0]
            found = {
                topic: messages[stamp]
                for topic, messages in self._messages.items()
                if stamp in messages
            }
            is_late = log_time_ns is None or log_time_ns - held_ns > _WAIT_NS
            if len(found) < len(self.topics) and not is_late:
                return
            self._held.popleft()
            yield item, found
