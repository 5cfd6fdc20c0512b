"""Conflicts in a ROS graph that the test makes up."""

from __future__ import annotations

import copy
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from rclpy.duration import Infinite
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from rover_obstacle_detection.node.connections import Connections
from rover_obstacle_detection.node.graph import UNKNOWN_NODE, look_at_graph

IMAGE, INFO, MASK = '/stereo/left/image_rect', '/stereo/left/camera_info', '/stereo/obstacle_mask'
RELIABLE = QoSProfile(depth=5)
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def endpoint(qos: QoSProfile, name: str = 'camera', namespace: str = '/stereo') -> Any:
    qos = copy.copy(qos)
    # As the graph reports the default; a profile of rclpy says 0.
    qos.deadline = qos.liveliness_lease_duration = Infinite
    return SimpleNamespace(node_name=name, node_namespace=namespace, qos_profile=qos)


class Graph:
    """Replaces the node's view of the graph."""

    def __init__(self) -> None:
        self.nodes = [('obstacle_detector', '/stereo'), ('camera', '/stereo')]
        self.publishers: dict[str, list[Any]] = {}
        self.subscribers: dict[str, list[Any]] = {}

    def get_fully_qualified_name(self) -> str:
        return '/stereo/obstacle_detector'

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        return self.nodes

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        return self.publishers.get(topic, [])

    def get_subscriptions_info_by_topic(self, topic: str) -> list[Any]:
        return self.subscribers.get(topic, [])

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [
            (topic, ['sensor_msgs/msg/CameraInfo' if topic == INFO else 'sensor_msgs/msg/Image'])
            for topic in {*self.publishers, *self.subscribers}
        ]

    def count_publishers(self, topic: str) -> int:
        return len(self.publishers.get(topic, []))

    def look(self, subscribed: QoSProfile = BEST_EFFORT) -> Connections:
        subscription = SimpleNamespace(topic_name=IMAGE, qos_profile=subscribed)
        publisher = SimpleNamespace(topic_name=MASK, qos_profile=RELIABLE)
        return look_at_graph(self, (IMAGE, INFO), [subscription], [publisher])


@pytest.fixture
def graph() -> Graph:
    graph = Graph()
    graph.publishers = {topic: [endpoint(RELIABLE)] for topic in (IMAGE, INFO)}
    graph.subscribers = {MASK: [endpoint(BEST_EFFORT, 'planner')]}
    return graph


def test_graph_without_conflict(graph: Graph) -> None:
    found = graph.look()

    assert (found.errors, found.warnings) == ((), ())
    assert found.publishers == dict.fromkeys((IMAGE, INFO), 'published by /stereo/camera')


def test_images_on_other_topics_are_listed_where_an_input_has_none(graph: Graph) -> None:
    graph.publishers['/cam1/image_raw'] = [endpoint(RELIABLE)]
    graph.publishers['/cam0/image_raw'] = [endpoint(RELIABLE)]
    graph.subscribers['/unpublished'] = [endpoint(RELIABLE, 'viewer')]
    assert graph.look().other_images == ()

    del graph.publishers[IMAGE]

    assert graph.look().other_images == ('/cam0/image_raw', '/cam1/image_raw')


def test_second_node_of_the_same_name(graph: Graph) -> None:
    graph.nodes.append(('obstacle_detector', '/other'))
    assert not graph.look().errors

    graph.nodes.append(('obstacle_detector', '/stereo'))

    (error,) = graph.look().errors
    assert error.startswith('2 nodes are called /stereo/obstacle_detector: expected 1')


def test_second_publisher_of_an_input(graph: Graph) -> None:
    graph.publishers[INFO].append(endpoint(RELIABLE, 'player', '/'))

    (error,) = graph.look().errors
    assert error.startswith(f'{INFO}: 2 publishers (/stereo/camera and /player): expected 1')


def test_subscriber_that_asks_for_more_than_is_offered(graph: Graph) -> None:
    graph.subscribers[MASK].append(endpoint(LATCHED, 'rviz', '/'))

    found = graph.look()

    assert found.errors == ()
    (warning,) = found.warnings
    assert warning.startswith(
        f'{MASK}: /rviz gets nothing: incompatible durability (volatile publisher and transient '
        'local subscription)'
    )


def test_publisher_that_offers_less_than_is_asked_for(graph: Graph) -> None:
    graph.publishers[IMAGE] = [endpoint(BEST_EFFORT)]
    assert not graph.look().errors

    (error,) = graph.look(subscribed=LATCHED).errors

    assert error.startswith(
        f'{IMAGE}: nothing can be received from /stereo/camera: incompatible reliability (best '
        'effort publisher and reliable subscription) and durability (volatile publisher'
    )


def test_topic_is_latched_if_all_its_publishers_are(graph: Graph) -> None:
    unreliable = QoSProfile(
        depth=1,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        reliability=ReliabilityPolicy.BEST_EFFORT,
    )
    graph.publishers[INFO] = [endpoint(LATCHED)]
    assert graph.look().latched == {IMAGE: False, INFO: True}

    graph.publishers[INFO] = [endpoint(unreliable)]
    assert graph.look().latched[INFO] is False

    graph.publishers[INFO] = [endpoint(LATCHED), endpoint(RELIABLE)]
    graph.publishers[IMAGE] = []
    found = graph.look()
    assert found.latched == {INFO: False}
    assert found.describe(IMAGE) == f'{IMAGE} (no publisher)'


def test_node_that_is_not_discovered_yet_has_no_name(graph: Graph) -> None:
    graph.publishers[IMAGE] = [endpoint(RELIABLE, UNKNOWN_NODE, '/')]

    assert graph.look().publishers[IMAGE] == 'published by an unknown node'
