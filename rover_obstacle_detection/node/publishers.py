"""The node's output topics; only those with subscribers cost anything."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.messages.outputs import OUTPUTS
from rover_obstacle_detection.node.rclpy_factory import RclpyFactory, message_type

# Two frames cover a subscriber's hiccup; a deeper queue of clouds costs memory.
DEPTH = 2


class OutputPublishers:
    """One reliable publisher for each entry of `OUTPUTS`.

    Parameters
    ----------
    node : rclpy node
    on_subscribers_changed : callable
        Called in the executor when a subscriber connects or disconnects.
    """

    def __init__(self, node: Any, on_subscribers_changed: Callable[[], None]) -> None:
        self._node = node
        self._factory = RclpyFactory()
        self._publishers = [
            (
                output,
                node.create_publisher(
                    message_type(output.type_name),
                    name,
                    QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE),
                    event_callbacks=PublisherEventCallbacks(
                        matched=lambda event: on_subscribers_changed(),
                        # rclpy polls every event handler on each wake-up; the default ones
                        # would double the node's idle load.
                        use_default_callbacks=False,
                    ),
                    qos_overriding_options=QoSOverridingOptions.with_default_policies(),
                ),
            )
            for name, output in OUTPUTS.items()
        ]

    @property
    def has_subscribers(self) -> bool:
        """Whether any output has a subscriber."""
        return any(publisher.get_subscription_count() for _, publisher in self._publishers)

    @property
    def publishers(self) -> tuple[Any, ...]:
        """The publishers of rclpy."""
        return tuple(publisher for _, publisher in self._publishers)

    def publish(self, detection: Detection, header: Any) -> None:
        """Make and publish the messages that have a subscriber.

        Parameters
        ----------
        detection : Detection
        header : std_msgs/Header
            Header of the left image, used for every message.
        """
        for output, publisher in self._publishers:
            if publisher.get_subscription_count():
                publisher.publish(output.encode(detection, header, self._factory))

    def publish_unknown(self, shape: tuple[int, int], config: DetectorConfig, header: Any) -> None:
        """Publish for a pair that cannot be judged: no ground is known to be free.

        Parameters
        ----------
        shape : tuple of int
            Height and width of the images.
        config : DetectorConfig
        header : std_msgs/Header
            Header of the left image, used for every message.
        """
        for output, publisher in self._publishers:
            if output.encode_unknown is not None and publisher.get_subscription_count():
                publisher.publish(output.encode_unknown(shape, config, header, self._factory))

    def destroy(self) -> None:
        """Remove the topics."""
        for _, publisher in self._publishers:
            self._node.destroy_publisher(publisher)
        self._publishers = []
