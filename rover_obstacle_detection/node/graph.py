"""Find conflicts in the ROS graph: doubled nodes and publishers, incompatible QoS."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from typing import Any

from rclpy.duration import Infinite
from rclpy.qos import (
    DurabilityPolicy,
    QoSCompatibility,
    ReliabilityPolicy,
    qos_check_compatible,
)

from rover_obstacle_detection.node.connections import NO_PUBLISHER, Connections

IMAGE_TYPE = 'sensor_msgs/msg/Image'
UNKNOWN_NODE = '_NODE_NAME_UNKNOWN_'
# Words by which rclpy's reasons can be told apart.
POLICIES = {
    'reliab': 'reliability',
    'local': 'durability',
    'deadline': 'deadline',
    'liveliness': 'liveliness',
}


def look_at_graph(
    node: Any, inputs: Sequence[str], subscriptions: Iterable[Any], publishers: Iterable[Any]
) -> Connections:
    """Look for conflicts; takes about a millisecond.

    Events of rclpy would report incompatible QoS too, but double the load of an idle node.

    Parameters
    ----------
    node : rclpy node
    inputs : sequence of str
        Full names of the input topics, each with one publisher at most.
    subscriptions, publishers : iterable of rclpy subscription, of rclpy publisher
        Those of this node.
    """
    publishers = list(publishers)
    known = {*inputs, *(publisher.topic_name for publisher in publishers)}
    offered = {topic: node.get_publishers_info_by_topic(topic) for topic in inputs}
    errors = [*_doubled_node(node), *_doubled_publishers(offered)]
    for subscription in subscriptions:
        topic = subscription.topic_name
        for other in offered.get(topic, ()):
            if reason := _incompatibility(other.qos_profile, _own(subscription)):
                errors.append(
                    f'{topic}: nothing can be received from {_node_of(other)}: {reason}; change '
                    'the QoS of that publisher'
                )
    warnings = [
        f'{publisher.topic_name}: {_node_of(other)} gets nothing: {reason}; change the QoS of '
        'that subscriber'
        for publisher in publishers
        for other in node.get_subscriptions_info_by_topic(publisher.topic_name)
        if (reason := _incompatibility(_own(publisher), other.qos_profile))
    ]
    return Connections(
        errors=tuple(errors),
        warnings=tuple(warnings),
        publishers={topic: _publishers(found) for topic, found in offered.items()},
        latched={topic: _latched(found) for topic, found in offered.items() if found},
        other_images=() if all(offered.values()) else tuple(_other_images(node, known)),
    )


def _other_images(node: Any, known: AbstractSet[str]) -> Iterator[str]:
    """Yield the image topics that are neither inputs nor outputs."""
    for topic, types in sorted(node.get_topic_names_and_types()):
        if topic not in known and IMAGE_TYPE in types and node.count_publishers(topic):
            yield topic


def _doubled_node(node: Any) -> list[str]:
    own = node.get_fully_qualified_name()
    count = [_full_name(*each) for each in node.get_node_names_and_namespaces()].count(own)
    if count < 2:
        return []
    return [
        f'{count} nodes are called {own}: expected 1, because all of them publish the same '
        'topics; stop the others, or give each its own namespace'
    ]


def _doubled_publishers(offered: dict[str, list[Any]]) -> list[str]:
    return [
        f'{topic}: {len(found)} publishers ({_nodes_of(found)}): expected 1, because their '
        'messages mix; stop the others'
        for topic, found in offered.items()
        if len(found) > 1
    ]


def _own(endpoint: Any) -> Any:
    # In a profile of rclpy, the default of a duration is 0; in the graph it is infinite.
    profile = copy.copy(endpoint.qos_profile)
    profile.deadline = profile.liveliness_lease_duration = Infinite
    return profile


def _incompatibility(offered: Any, requested: Any) -> str:
    compatibility, reasons = qos_check_compatible(offered, requested)
    if compatibility != QoSCompatibility.ERROR:
        return ''
    found = [
        reason.removeprefix('ERROR: ').strip().lower()
        for reason in reasons.split(';')
        if reason.startswith('ERROR: ')
    ]
    return 'incompatible ' + ' and '.join(f'{_policy(reason)} ({reason})' for reason in found)


def _policy(reason: str) -> str:
    return next((name for word, name in POLICIES.items() if word in reason), 'QoS')


def _publishers(found: Sequence[Any]) -> str:
    return f'published by {_nodes_of(found)}' if found else NO_PUBLISHER


def _latched(found: Sequence[Any]) -> bool:
    # Best-effort publishers keep nothing for late subscribers.
    return all(
        each.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        and each.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        for each in found
    )


def _nodes_of(endpoints: Sequence[Any]) -> str:
    return ' and '.join(_node_of(each) for each in endpoints)


def _node_of(endpoint: Any) -> str:
    if endpoint.node_name == UNKNOWN_NODE:
        return 'an unknown node'
    return _full_name(endpoint.node_name, endpoint.node_namespace)


def _full_name(name: str, namespace: str) -> str:
    return f'{namespace.rstrip("/")}/{name}'
