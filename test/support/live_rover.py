"""A running node with a simulated camera and a subscriber to its mask."""

from __future__ import annotations

from typing import Any

import numpy as np
from live_graph import Camera, LiveGraph

SECOND = 1_000_000_000
START_NS = 1000 * SECOND
PERIOD_NS = SECOND // 10


class Rover:
    """Starts the node in namespace /stereo and gives each pair a new stamp.

    Without ``watchdog``, a test may send one pair again and again.
    """

    def __init__(
        self,
        graph: LiveGraph,
        *ros_arguments: str,
        watchdog: bool = False,
        camera: Camera | None = None,
    ) -> None:
        self.graph = graph
        self.mask = graph.subscribe('sensor_msgs/msg/Image', '/stereo/obstacle_mask')
        self.diagnostics = graph.diagnostics()
        watched = f'watchdog:={watchdog}'.lower()
        self.process = graph.start_node('-p', watched, *ros_arguments)
        self.camera = camera or Camera(graph)
        self._stamp = START_NS

    def next_stamp(self) -> int:
        self._stamp += PERIOD_NS
        return self._stamp

    def images(self, view: Any) -> tuple[Any, Any]:
        stamp = self.next_stamp()
        return self.camera.image(view.left, stamp), self.camera.image(view.right, stamp)

    def wait_for(self, condition: Any) -> None:
        self.graph.wait_for(condition, self.process)

    def wait_for_mask(self, stamp: int) -> np.ndarray:
        self.wait_for(lambda: stamp in self.mask.stamps_ns)
        message = self.mask.at(stamp)
        return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width)

    def detect(self, view: Any) -> np.ndarray:
        """Send a pair with its calibration; return the mask."""
        stamp = self.next_stamp()
        self.camera.send(view.scene.camera, view.left, view.right, stamp)
        return self.wait_for_mask(stamp)

    def request_parameters(self, **values: Any) -> Any:
        """Ask to set parameters atomically; return ``SetParametersResult``."""
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter

        request = SetParametersAtomically.Request(
            parameters=[
                Parameter(name, value=each).to_parameter_msg() for name, each in values.items()
            ]
        )
        name = '/stereo/obstacle_detector/set_parameters_atomically'
        return self.graph.call(SetParametersAtomically, name, request).result

    def set(self, **values: Any) -> None:
        assert self.request_parameters(**values).successful

    def transition(self, name: str) -> None:
        """Request a lifecycle transition, such as ``activate``."""
        from lifecycle_msgs.msg import Transition
        from lifecycle_msgs.srv import ChangeState

        number = getattr(Transition, f'TRANSITION_{name.upper()}')
        request = ChangeState.Request(transition=Transition(id=number))
        service = '/stereo/obstacle_detector/change_state'
        assert self.graph.call(ChangeState, service, request).success
