"""What the node subscribes to, on a node that the test makes up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy, qos_profile_sensor_data

from rover_obstacle_detection.node.calibration import LiveCalibration
from rover_obstacle_detection.node.inputs import StereoInputs, subscribe
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.statistics import NodeStatistics

LEFT, RIGHT = '/stereo/left/camera_info', '/stereo/right/camera_info'


class Node:
    """Keeps the current subscriptions by topic."""

    def __init__(self) -> None:
        self.profiles: dict[str, Any] = {}

    def resolve_topic_name(self, topic: str) -> str:
        return f'/stereo/{topic}'

    def create_subscription(
        self, type_: Any, topic: str, callback: Any, profile: Any, **options: Any
    ) -> Any:
        assert topic not in self.profiles
        self.profiles[topic] = profile
        return SimpleNamespace(topic=topic)

    def destroy_subscription(self, subscription: Any) -> None:
        del self.profiles[subscription.topic]

    def is_latched(self) -> list[bool]:
        return [
            (profile.durability, profile.reliability)
            == (DurabilityPolicy.TRANSIENT_LOCAL, ReliabilityPolicy.RELIABLE)
            for profile in (self.profiles[f'{side}/camera_info'] for side in ('left', 'right'))
        ]


@pytest.fixture
def node() -> Node:
    return Node()


@pytest.fixture
def inputs(node: Node) -> StereoInputs:
    return StereoInputs(
        node,
        Settings.from_values({}),
        calibration=LiveCalibration(LEFT, RIGHT),
        statistics=NodeStatistics(),
        on_image=lambda side: None,
        on_pair=lambda pair: None,
        warn=lambda text: None,
    )


def test_calibration_is_subscribed_to_as_it_is_published(node: Node, inputs: StereoInputs) -> None:
    assert (inputs.info_topics, node.is_latched()) == ((LEFT, RIGHT), [False, False])

    inputs.set_latched({LEFT: False, RIGHT: True})
    assert node.is_latched() == [False, True]

    # Without a publisher, nothing changes.
    inputs.set_latched({})
    assert node.is_latched() == [False, True]

    inputs.set_latched({RIGHT: False})
    assert node.is_latched() == [False, False]


def test_override_of_one_subscription_leaves_the_default_alone(node: Node) -> None:
    subscribe(node, 'sensor_msgs/msg/Image', 'left/image_rect', lambda image: None)

    profile = node.profiles['left/image_rect']
    assert profile == qos_profile_sensor_data
    assert profile is not qos_profile_sensor_data
