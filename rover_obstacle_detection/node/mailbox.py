"""Hand-over from the callbacks to the worker: only the newest item is kept."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar('Item')


class Mailbox(Generic[Item]):
    """Holds at most one item; a new one replaces one that was not taken.

    `put` never blocks, so callbacks return at once however busy the worker is.

    Parameters
    ----------
    on_drop : callable
        Called for each item that is never taken.
    """

    def __init__(self, on_drop: Callable[[], None]) -> None:
        self._on_drop = on_drop
        self._condition = threading.Condition()
        self._item: Item | None = None
        self._closed = False

    def put(self, item: Item) -> None:
        """Store an item in place of the current one."""
        with self._condition:
            if self._closed or self._item is not None:
                self._on_drop()
            self._item = None if self._closed else item
            self._condition.notify()

    def take(self) -> Item | None:
        """Wait for an item and remove it; None after `close`."""
        with self._condition:
            self._condition.wait_for(lambda: self._item is not None or self._closed)
            item, self._item = self._item, None
            return item

    def close(self) -> None:
        """Drop the current item; `take` returns None from now on."""
        with self._condition:
            if self._item is not None:
                self._on_drop()
            self._item = None
            self._closed = True
            self._condition.notify_all()
