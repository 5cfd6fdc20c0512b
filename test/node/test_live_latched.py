"""A camera that published its calibration once, before the node started."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import Camera, live_graph
from live_rover import Rover
from rclpy.qos import DurabilityPolicy, QoSProfile

VIEW = synthetic.render(synthetic.mast())
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_latched_calibration_is_received(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        camera = Camera(graph, info_qos=LATCHED)
        camera.send_infos(VIEW.scene.camera, 1)
        rover = Rover(graph, camera=camera)
        rover.wait_for(lambda: 'camera: 320 x 240' in rover.process.output)
        rover.camera.wait_for_subscribers()

        rover.camera.send_images(*rover.images(VIEW))

        rover.wait_for(lambda: rover.mask.messages)
        rover.wait_for(lambda: rover.diagnostics.message('connections') == 'no conflict')
        status = rover.diagnostics.statuses['connections']
        assert status.name == '/stereo/obstacle_detector: connections'
        assert status.hardware_id == '/stereo/left'
        # A node can be discovered after its topics.
        rover.wait_for(
            lambda: (
                rover.diagnostics.value('connections', '/stereo/left/camera_info')
                == 'published by /test'
            )
        )
