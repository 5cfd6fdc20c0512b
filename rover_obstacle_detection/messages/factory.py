"""How a message is made, whichever library its class comes from."""

from __future__ import annotations

from typing import Any, Protocol


class MessageFactory(Protocol):
    """Makes messages of one library.

    The functions of this package give it numbers as Python numbers, texts, nested messages that
    the same factory made, sequences of them as lists, and numeric sequences as contiguous
    one-dimensional arrays of the field's type (bytes: uint8).
    """

    def make(self, type_name: str, **fields: Any) -> Any:
        """Make a message.

        Parameters
        ----------
        type_name : str
            Such as ``sensor_msgs/msg/Image``.
        **fields
            The fields that are not zero, empty or default.
        """
        ...
