"""A pair on its way from the callbacks to the worker."""

from __future__ import annotations

from typing import Any, NamedTuple


class ImagePair(NamedTuple):
    """A pair as it arrived: messages, not yet decoded.

    Parameters
    ----------
    left, right : sensor_msgs/Image or CompressedImage
    arrival_s : float
        Monotonic time at which the second of them arrived.
    """

    left: Any
    right: Any
    arrival_s: float
