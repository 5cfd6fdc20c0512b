"""Lifecycle transitions, idle behaviour and the end of the process."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import Camera, LiveGraph, Process, live_graph

from rover_obstacle_detection.messages.header import stamp_ns

VIEW = synthetic.render(synthetic.mast())
OTHER = synthetic.render(synthetic.hazard_camera(240, 180))
MASK = '/stereo/obstacle_mask'
LEFT_IMAGE = '/stereo/left/image_rect'


def state(graph: LiveGraph) -> str:
    from lifecycle_msgs.srv import GetState

    answer = graph.call(GetState, '/stereo/obstacle_detector/get_state', GetState.Request())
    return str(answer.current_state.label)


def change(graph: LiveGraph, name: str) -> bool:
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    number = getattr(Transition, f'TRANSITION_{name.upper()}')
    request = ChangeState.Request(transition=Transition(id=number))
    return bool(graph.call(ChangeState, '/stereo/obstacle_detector/change_state', request).success)


class Stream:
    """Sends pairs stamped with the current time, in two exposures in turn."""

    def __init__(self, graph: LiveGraph) -> None:
        self.camera = Camera(graph)
        self.view = VIEW
        self._sent = 0

    def send(self) -> None:
        self._sent += 1
        view = self.view if self._sent % 2 else synthetic.exposed_again(self.view)
        self.camera.send(view.scene.camera, view.left, view.right, time.time_ns())


def wait_for_new_mask(graph: LiveGraph, masks: Any, stream: Stream, process: Process) -> None:
    count = len(masks.messages)

    def received() -> bool:
        stream.send()
        return len(masks.messages) > count

    graph.wait_for(received, process)


def test_lifecycle_transitions_by_a_manager(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        diagnostics = graph.diagnostics()
        masks = graph.subscribe('sensor_msgs/msg/Image', MASK)
        process = graph.start(
            'run', '--namespace', 'stereo', '--ros-args', '-p', 'autostart:=false'
        )
        stream = Stream(graph)
        assert state(graph) == 'unconfigured'
        graph.wait_for(lambda: diagnostics.message('stereo input').startswith('unconfigured'))

        assert change(graph, 'configure')
        assert state(graph) == 'inactive'
        graph.wait_for(lambda: graph.node.count_publishers(MASK) == 1)
        assert graph.node.count_subscribers(LEFT_IMAGE) == 0

        for _ in range(2):
            assert change(graph, 'activate')
            wait_for_new_mask(graph, masks, stream, process)
            assert state(graph) == 'active'
            assert change(graph, 'deactivate')
            graph.wait_for(lambda: graph.node.count_subscribers(LEFT_IMAGE) == 0)

        assert change(graph, 'cleanup')
        graph.wait_for(lambda: graph.node.count_publishers(MASK) == 0)
        assert change(graph, 'configure')
        assert change(graph, 'activate')
        wait_for_new_mask(graph, masks, stream, process)

        assert change(graph, 'active_shutdown')
        assert state(graph) == 'finalized'
        assert process.stop() == 0
        assert 'Traceback' not in process.output


def test_node_is_idle_without_subscribers(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        diagnostics = graph.diagnostics()
        process = graph.start_node()
        stream = Stream(graph)
        graph.wait_for(lambda: diagnostics.message('detection').startswith('idle'))
        assert graph.node.count_subscribers(LEFT_IMAGE) == 0
        graph.wait_for(lambda: 'INFO' in process.output and 'idle: no output' in process.output)

        # A subscriber to any output makes it work.
        markers = graph.subscribe('visualization_msgs/msg/MarkerArray', '/stereo/obstacle_markers')
        wait_for_new_mask(graph, markers, stream, process)

        graph.unsubscribe(markers)
        for topic in (LEFT_IMAGE, '/stereo/left/camera_info'):
            graph.wait_for(lambda topic=topic: graph.node.count_subscribers(topic) == 0)
        graph.wait_for(lambda: diagnostics.message('detection').startswith('idle'))
        graph.wait_for(lambda: diagnostics.message('calibration') == 'calibrated')

        # A camera changed while idle is noticed with the first pair.
        # The detection of an earlier pair may still be running.
        stream.view, changed_ns = OTHER, time.time_ns()
        masks = graph.subscribe('sensor_msgs/msg/Image', MASK)

        def new_masks() -> list[Any]:
            return [each for each in masks.messages if stamp_ns(each.header) > changed_ns]

        graph.wait_for(lambda: stream.send() or new_masks(), process)
        assert (new_masks()[0].width, new_masks()[0].height) == (240, 180)


@pytest.mark.parametrize(
    'signals',
    [
        (signal.SIGINT, signal.SIGINT),
        (signal.SIGTERM,),
    ],
    ids=lambda signals: '+'.join(each.name for each in signals),
)
def test_signal_during_detection_exits_cleanly(
    tmp_path: Path, signals: tuple[signal.Signals, ...]
) -> None:
    with live_graph(tmp_path) as graph:
        masks = graph.subscribe('sensor_msgs/msg/Image', MASK)
        process = graph.start_node()
        stream = Stream(graph)
        wait_for_new_mask(graph, masks, stream, process)
        for _ in range(20):
            stream.send()

        for number in signals:
            process.send(number)

        assert process.wait() == 0
        assert 'Traceback' not in process.output
        assert 'rror' not in process.output
