"""Who else is on the node's topics, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field

NO_PUBLISHER = 'no publisher'


@dataclass(frozen=True)
class Connections:
    """What the ROS graph shows at one moment.

    Parameters
    ----------
    errors : tuple of str
        Conflicts that spoil the input or the output.
    warnings : tuple of str
        Subscribers that get nothing.
    publishers : dict of str to str
        Who publishes each input topic.
    latched : dict of str to bool
        Whether all publishers of an input topic keep their last message for late subscribers.
        Topics without a publisher are left out.
    other_images : tuple of str
        Image topics that somebody publishes, while an input topic has no publisher.
    """

    errors: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    publishers: dict[str, str] = field(default_factory=dict)
    latched: dict[str, bool] = field(default_factory=dict)
    other_images: tuple[str, ...] = ()

    def describe(self, topic: str) -> str:
        """Return the topic with its publishers, such as ``/left/image_rect (no publisher)``."""
        return f'{topic} ({self.publishers.get(topic, NO_PUBLISHER)})'


NOTHING_SEEN = Connections()
