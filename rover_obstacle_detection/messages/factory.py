"""Interface for making messages with either message library."""

from __future__ import annotations

from typing import Any, Protocol


class MessageFactory(Protocol):
    """Makes messages of one library.

    Field values are Python numbers, strings, messages from the same factory, or lists of such
    messages. Numeric sequences are contiguous one-dimensional arrays of the field's type.
    """

    def make(self, type_name: str, **fields: Any) -> Any:
        """Make a message.

        Parameters
        ----------
        type_name : str
            For example ``sensor_msgs/msg/Image``.
        **fields
            Field values; fields not given keep their default.
        """
        ...
