"""The watchdog over DDS: what is published while a camera is frozen."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import live_graph
from live_rover import Rover

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
ERROR = 2


class WatchedRover(Rover):
    """Counts exposures, and subscribes to the clouds as well."""

    def __init__(self, graph: Any) -> None:
        clouds = {
            name: graph.subscribe('sensor_msgs/msg/PointCloud2', f'/stereo/{name}')
            for name in ('ground_points', 'obstacle_points')
        }
        self.ground, self.obstacles = clouds['ground_points'], clouds['obstacle_points']
        self.known = graph.subscribe('sensor_msgs/msg/Image', '/stereo/debug/known')
        self.grid = graph.subscribe('nav_msgs/msg/OccupancyGrid', '/stereo/obstacle_grid')
        self._exposures = 0
        super().__init__(graph, '-p', 'frozen_after:=5', watchdog=True)

    def send(self, left: np.ndarray | None = None, right: np.ndarray | None = None) -> int:
        """Send a new exposure, except of the images that are given."""
        self._exposures += 1
        view = synthetic.exposed_again(VIEW, seed=self._exposures)
        stamp = self.next_stamp()
        left = view.left if left is None else left
        right = view.right if right is None else right
        self.camera.send(view.scene.camera, left, right, stamp)
        return stamp

    def ground_at(self, stamp: int) -> Any:
        self.wait_for(lambda: stamp in self.ground.stamps_ns)
        return self.ground.at(stamp)

    def wait_for_status(self, task: str, level: int, pattern: str) -> None:
        self.wait_for(
            lambda: (
                re.search(pattern, self.diagnostics.message(task))
                and self.diagnostics.level(task) == level
            )
        )


@pytest.fixture(scope='module')
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[WatchedRover]:
    with live_graph(tmp_path_factory.mktemp('watchdog')) as graph:
        rover = WatchedRover(graph)
        rover.camera.wait_for_subscribers()
        yield rover


def test_frozen_camera_gives_no_free_ground_until_it_recovers(rover: WatchedRover) -> None:
    frozen = synthetic.exposed_again(VIEW, seed=1000).left
    for _ in range(5):
        assert rover.ground_at(rover.send(left=frozen)).width > 1000

    stamps = []
    for _ in range(7):
        stamps.append(rover.send(left=frozen))
        cloud = rover.ground_at(stamps[-1])
        assert (cloud.width, len(cloud.data)) == (0, 0)
        assert cloud.header.frame_id == 'stereo_left_optical_frame'
    rover.wait_for(lambda: stamps[-1] in rover.known.stamps_ns)
    assert not any(rover.known.at(stamps[-1]).data)
    rover.wait_for(lambda: stamps[-1] in rover.grid.stamps_ns)
    assert set(rover.grid.at(stamps[-1]).data) == {-1}
    # Every message on these topics would say that there is no obstacle.
    for topic in (rover.mask, rover.obstacles):
        assert not set(stamps) & set(topic.stamps_ns)
    words = r'left image has not changed for 11 frames \(1\.1 s\): the camera or its driver is'
    rover.wait_for_status('stereo input', ERROR, words)
    rover.wait_for_status('detection', ERROR, 'none of the last .* left image has not changed')
    assert re.search('ERROR.*left image has not changed for 5 frames', rover.process.output)

    stamp = rover.send()

    assert rover.ground_at(stamp).width > 1000
    assert rover.wait_for_mask(stamp).any()
    rover.wait_for(lambda: stamp in rover.grid.stamps_ns)
    assert set(rover.grid.at(stamp).data) == {-1, 0, 100}
    rover.wait_for(lambda: 'images change again' in rover.process.output)
    rover.wait_for(lambda: rover.send() and rover.diagnostics.level('stereo input') == 0)
    assert rover.process.output.count('images change again') == 1
    assert rover.diagnostics.value('detection', 'bad frames: frozen image') == '7'


def test_same_pixels_are_no_fault_without_the_watchdog(rover: WatchedRover) -> None:
    rover.set(watchdog=False)

    for _ in range(8):
        assert rover.ground_at(rover.send(VIEW.left, VIEW.right)).width > 1000

    rover.set(watchdog=True)


def test_fault_is_logged_after_a_warning(rover: WatchedRover) -> None:
    left, right = rover.images(VIEW)
    left.header.stamp.sec, left.header.stamp.nanosec = 0, 0
    rover.camera.send_images(left, right)
    rover.wait_for(lambda: re.search(r'WARN.*header\.stamp is zero', rover.process.output))

    for _ in range(6):
        rover.ground_at(rover.send(right=VIEW.right))

    rover.wait_for(lambda: re.search('ERROR.*right image has not changed', rover.process.output))
    assert rover.ground_at(rover.send()).width > 1000
    assert 'Traceback' not in rover.process.output
