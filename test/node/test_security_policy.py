"""The SROS 2 policy allows what the node creates, and nothing else."""

from __future__ import annotations

import re
import xml.etree.ElementTree
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from live_graph import live_graph
from live_rover import Rover

POLICY = Path(__file__).parents[2] / 'config' / 'sros2_policy.xml'
NODE, NAMESPACE = 'obstacle_detector', '/stereo'
KINDS = ('subscribe', 'publish', 'reply', 'request')


def allowed() -> dict[str, set[str]]:
    """Full names that the policy allows, by kind, expanded as `ros2 security` does."""
    (profile,) = xml.etree.ElementTree.parse(POLICY).iter('profile')
    assert (profile.get('ns'), profile.get('node')) == (NAMESPACE, NODE)
    names: dict[str, set[str]] = {kind: set() for kind in KINDS}
    for group in profile:
        assert len(group.attrib) == 1
        ((kind, rule),) = group.attrib.items()
        assert rule == 'ALLOW'
        for each in group:
            name = re.sub('^~', NODE, each.text or '')
            names[kind].add(name if name.startswith('/') else f'{NAMESPACE}/{name}')
    return names


def test_policy_is_of_the_enclave_that_the_documentation_names() -> None:
    (context,) = xml.etree.ElementTree.parse(POLICY).iter('context')
    assert context.get('path') == f'{NAMESPACE}/{NODE}'


def test_policy_allows_what_the_node_creates_and_nothing_else(tmp_path: Path) -> None:
    created: dict[str, set[str]] = {kind: set() for kind in KINDS}
    with live_graph(tmp_path) as graph:
        node = graph.node
        queries = {
            'subscribe': node.get_subscriber_names_and_types_by_node,
            'publish': node.get_publisher_names_and_types_by_node,
            'reply': node.get_service_names_and_types_by_node,
            'request': node.get_client_names_and_types_by_node,
        }

        def look() -> None:
            for kind, query in queries.items():
                created[kind] |= {name for name, _ in query(NODE, NAMESPACE)}

        def seen(*names: str) -> bool:
            look()
            return created['subscribe'] >= set(names)

        rover = Rover(graph, '-p', 'use_sim_time:=true')
        rover.camera.wait_for_subscribers()
        rover.wait_for(lambda: seen('/stereo/right/image_rect', '/clock'))
        rover.set(gravity_source='imu', image_transport='compressed')
        rover.wait_for(lambda: seen('/stereo/imu', '/stereo/right/image_rect/compressed'))
        rover.wait_for(lambda: created['publish'] >= allowed()['publish'])

    # The node can only listen to these where tf2_ros is installed, which is not on PyPI.
    created['subscribe'] |= {'/tf', '/tf_static'}
    assert created == allowed()
