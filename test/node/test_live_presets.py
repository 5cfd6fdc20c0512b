"""The node on the topics of a camera driver."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from live_graph import LiveGraph, live_graph

NAMES = ('image_rect', 'camera_info')
OAK = {f'/oak/{side}/{name}' for side in ('left', 'right') for name in NAMES}


def subscribed(graph: LiveGraph) -> set[str]:
    """Input topics of the node; none before it is discovered."""
    from rclpy.node import NodeNameNonExistentError

    try:
        found = graph.node.get_subscriber_names_and_types_by_node('obstacle_detector', '/stereo')
    except NodeNameNonExistentError:
        return set()
    return {topic for topic, _ in found if topic.rpartition('/')[2] in NAMES}


def parameter(graph: LiveGraph, name: str) -> bool:
    from rcl_interfaces.srv import GetParameters

    request = GetParameters.Request(names=[name])
    answer = graph.call(GetParameters, '/stereo/obstacle_detector/get_parameters', request)
    return bool(answer.values[0].bool_value)


def test_preset_subscribes_to_the_drivers_topics(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        graph.subscribe('sensor_msgs/msg/Image', '/stereo/obstacle_mask')
        graph.start('run', '--namespace', 'stereo', '--camera', 'oak')
        graph.wait_for(lambda: subscribed(graph) == OAK)
        assert parameter(graph, 'approximate_sync')


def test_given_topics_and_parameters_take_precedence(tmp_path: Path) -> None:
    own = tmp_path / 'own.yaml'
    own.write_text('/**: {ros__parameters: {approximate_sync: false}}')
    arguments = ['--ros-args', '-r', 'left/image_rect:=/mine/left/image_rect']
    with live_graph(tmp_path) as graph:
        graph.subscribe('sensor_msgs/msg/Image', '/stereo/obstacle_mask')
        graph.start(
            'run', '--namespace', 'stereo', '--camera', 'oak', '--params', str(own), *arguments
        )
        expected = OAK - {'/oak/left/image_rect'} | {'/mine/left/image_rect'}
        graph.wait_for(lambda: subscribed(graph) == expected)
        assert not parameter(graph, 'approximate_sync')
