"""Conflicts in a real ROS graph: each is named in the log and on /diagnostics until it ends."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import Camera, live_graph, message_type
from live_rover import Rover
from rclpy.qos import DurabilityPolicy, QoSProfile

VIEW = synthetic.render(synthetic.mast())
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
OK, WARN, ERROR = range(3)


class ConnectedRover(Rover):
    def expect(self, level: int, pattern: str) -> None:
        """Wait for a line in the log and the same on /diagnostics."""
        word = 'ERROR' if level == ERROR else 'WARN'
        self.wait_for(lambda: re.search(f'{word}.*{pattern}', self.process.output))
        self.wait_for(
            lambda: (
                re.search(pattern, self.diagnostics.message('connections'))
                and self.diagnostics.level('connections') == level
            )
        )

    def expect_no_conflict(self) -> None:
        self.wait_for(lambda: self.diagnostics.message('connections') == 'no conflict')


@pytest.fixture(scope='module')
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConnectedRover]:
    """A rover whose camera published its calibration once, before the node started."""
    with live_graph(tmp_path_factory.mktemp('connections')) as graph:
        camera = Camera(graph, info_qos=LATCHED)
        camera.send_infos(VIEW.scene.camera, 1)
        yield ConnectedRover(graph, camera=camera)


def test_latched_calibration_is_received(rover: ConnectedRover) -> None:
    rover.wait_for(lambda: 'camera: 320 x 240' in rover.process.output)
    rover.camera.wait_for_subscribers()
    stamp = rover.next_stamp()
    rover.camera.send_images(
        rover.camera.image(VIEW.left, stamp), rover.camera.image(VIEW.right, stamp)
    )

    assert rover.wait_for_mask(stamp).shape == (240, 320)
    rover.expect_no_conflict()
    status = rover.diagnostics.statuses['connections']
    assert status.name == '/stereo/obstacle_detector: connections'
    assert status.hardware_id == '/stereo/left'
    published = rover.diagnostics.value('connections', '/stereo/left/camera_info')
    assert published == 'published by /test'


def test_subscriber_with_incompatible_qos(rover: ConnectedRover) -> None:
    late = rover.graph.subscribe('sensor_msgs/msg/Image', '/stereo/obstacle_mask', LATCHED)

    rover.expect(
        WARN,
        r'/stereo/obstacle_mask: /test gets nothing: incompatible durability \(volatile '
        'publisher and transient local subscription',
    )

    rover.graph.unsubscribe(late)
    rover.expect_no_conflict()


def test_second_publisher_of_an_image(rover: ConnectedRover) -> None:
    topic = '/stereo/left/image_rect'
    second = rover.graph.node.create_publisher(message_type('sensor_msgs/msg/Image'), topic, 10)

    rover.expect(ERROR, rf'{topic}: 2 publishers \(/test and /test\): expected 1')

    rover.graph.node.destroy_publisher(second)
    rover.expect_no_conflict()


def test_second_node_of_the_same_name(rover: ConnectedRover) -> None:
    second = rover.graph.create_node('obstacle_detector', namespace='/stereo')

    rover.expect(ERROR, '2 nodes are called /stereo/obstacle_detector: expected 1')

    second.destroy_node()
    rover.expect_no_conflict()
    rover.detect(VIEW)
