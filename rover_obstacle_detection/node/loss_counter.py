"""How many messages of a publisher never arrived, by the numbers that the transport gives them."""

from __future__ import annotations

# A jump further than this is another publisher's numbering.
LONGEST_GAP = 1000


class LossCounter:
    """Counts the numbers left out between the messages of one topic that arrived.

    It sees what the network lost as well as what newer messages pushed out of a full queue.
    """

    def __init__(self) -> None:
        self._last: int | None = None

    def lost_before(self, number: int | None) -> int:
        """Count the messages missing between the one before and this one.

        Parameters
        ----------
        number : int or None
            The publisher's number of this message; None where the middleware has none.
        """
        last, self._last = self._last, number
        if last is None or number is None:
            return 0
        missing = number - last - 1
        return missing if 0 < missing <= LONGEST_GAP else 0
