"""The node's output topics: nothing is made for a topic that nobody listens to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.messages.outputs import OUTPUTS
from rover_obstacle_detection.node.rclpy_factory import RclpyFactory, message_type

# A deep queue of clouds would cost memory; two frames bridge a reader's hiccup.
DEPTH = 2


class OutputPublishers:
    """One publisher for each entry of `OUTPUTS`, reliable.

    Parameters
    ----------
    node : rclpy node
    on_audience : callable
        Called in the executor whenever a subscriber comes or goes.
    """

    def __init__(self, node: Any, on_audience: Callable[[], None]) -> None:
        self._node = node
        self._factory = RclpyFactory()
        self._publishers = [
            (
                output,
                node.create_publisher(
                    message_type(output.type_name),
                    name,
                    QoSProfile(
                        history=HistoryPolicy.KEEP_LAST,
                        depth=DEPTH,
                        reliability=ReliabilityPolicy.RELIABLE,
                    ),
                    event_callbacks=PublisherEventCallbacks(
                        matched=lambda event: on_audience(),
                        # rclpy goes through every event handler with every message that comes:
                        # two more for each output would double what the node costs at rest.
                        use_default_callbacks=False,
                    ),
                    qos_overriding_options=QoSOverridingOptions.with_default_policies(),
                ),
            )
            for name, output in OUTPUTS.items()
        ]

    @property
    def audience(self) -> bool:
        """Whether anybody listens to anything."""
        return any(publisher.get_subscription_count() for _, publisher in self._publishers)

    def publish(self, detection: Detection, header: Any) -> None:
        """Make and send the messages that have a subscriber.

        Parameters
        ----------
        detection : Detection
        header : std_msgs/Header
            Of the left image: stamp and frame of everything sent.
        """
        for output, publisher in self._publishers:
            if publisher.get_subscription_count():
                publisher.publish(output.encode(detection, header, self._factory))

    def destroy(self) -> None:
        """Take the topics down."""
        for _, publisher in self._publishers:
            self._node.destroy_publisher(publisher)
        self._publishers = []
