"""Count messages lost in transport by the publisher's sequence numbers."""

from __future__ import annotations

# A larger jump means another publisher.
MAX_GAP = 1000


class LossCounter:
    """Counts gaps in the sequence numbers of one topic.

    This includes messages lost on the network and messages pushed out of a full queue.
    """

    def __init__(self) -> None:
        self._last: int | None = None

    def lost_before(self, number: int | None) -> int:
        """Return how many messages are missing between the previous one and this one.

        Parameters
        ----------
        number : int or None
            Sequence number of this message; None if the middleware provides none.
        """
        last, self._last = self._last, number
        if last is None or number is None:
            return 0
        missing = number - last - 1
        return missing if 0 < missing <= MAX_GAP else 0
