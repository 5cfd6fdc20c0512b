"""Play bags into the node and compare its outputs with those of the replay."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import ROOT, LiveGraph, Process, Topic, live_graph, write_stereo_bag

from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.detection.network.inference import WITHOUT_ONNX_RUNTIME
from rover_obstacle_detection.detection.rocks.outline_model import outline_model
from rover_obstacle_detection.messages.header import stamp_ns

BAG = ROOT / 'bags' / 'mars_yard'
OUTPUTS = {
    '/stereo/obstacle_mask': 'sensor_msgs/msg/Image',
    '/stereo/obstacle_points': 'sensor_msgs/msg/PointCloud2',
    '/stereo/ground_points': 'sensor_msgs/msg/PointCloud2',
    '/stereo/obstacle_grid': 'nav_msgs/msg/OccupancyGrid',
}
# Slow enough to detect every pair on a busy machine.
RATE = '0.5'
SECOND = 1_000_000_000
START_NS = 1_600_000_000 * SECOND


@pytest.fixture(scope='module')
def replayed(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], Any]:
    """Messages written by the replay, by topic and stamp."""
    folder = tmp_path_factory.mktemp('replay') / 'out'
    assert main(['replay', str(BAG), '--output', str(folder)]) == 0
    with open_bag(folder / 'detections') as bag:
        return {
            (topic, stamp_ns(message.header)): message
            for topic, _, message in bag.messages(tuple(OUTPUTS))
        }


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveGraph]:
    with live_graph(tmp_path_factory.mktemp('bag')) as graph:
        yield graph


@pytest.fixture(scope='module')
def outputs(graph: LiveGraph) -> dict[str, Topic]:
    return {topic: graph.subscribe(type_, topic) for topic, type_ in OUTPUTS.items()}


@pytest.fixture(scope='module')
def node(graph: LiveGraph, outputs: dict[str, Topic]) -> Process:
    process = graph.start_node()
    graph.wait_until_listening('/stereo/left/image_rect', '/stereo/right/image_rect')
    return process


def pose_of(grid: Any) -> list[float]:
    origin = grid.info.origin
    parts = [*(getattr(origin.position, axis) for axis in 'xyz')]
    return [*parts, *(getattr(origin.orientation, axis) for axis in 'xyzw')]


def test_node_and_replay_publish_identical_messages(
    graph: LiveGraph,
    node: Process,
    outputs: dict[str, Topic],
    replayed: dict[tuple[str, int], Any],
) -> None:
    player = graph.start('play', str(BAG), '--rate', RATE)
    stamps = sorted(stamp for topic, stamp in replayed if topic == '/stereo/obstacle_mask')
    assert len(stamps) == 3
    graph.wait_for(
        lambda: all(len(topic.messages) >= len(stamps) for topic in outputs.values()), node
    )
    assert player.wait() == 0

    for name, topic in outputs.items():
        assert topic.stamps_ns == stamps, name
        for message in topic.messages:
            expected = replayed[name, stamp_ns(message.header)]
            assert message.header.frame_id == expected.header.frame_id
            assert message.header.frame_id == 'stereo_left_optical_frame'
            if name == '/stereo/obstacle_grid':
                assert (message.info.width, message.info.height) == (100, 100)
                assert pose_of(message) == pose_of(expected)
                assert set(message.data) == {-1, 0, 100}
            else:
                assert (message.width, message.height) == (expected.width, expected.height)
            assert bytes(message.data) == bytes(expected.data)
    # This is the live test that also runs without ONNX Runtime.
    assert (WITHOUT_ONNX_RUNTIME in node.output) != outline_model().is_fast


@pytest.fixture(scope='module')
def short_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four small pairs in a second."""
    view = synthetic.render(synthetic.mast())
    path = tmp_path_factory.mktemp('recorded') / 'short'
    write_stereo_bag(
        path, view, [START_NS + number * SECOND // 4 for number in range(4)], end=START_NS + SECOND
    )
    return path


def test_node_handles_loop_and_restart_of_a_bag(
    graph: LiveGraph, node: Process, outputs: dict[str, Topic], short_bag: Path
) -> None:
    masks = outputs['/stereo/obstacle_mask']
    masks.messages.clear()

    looping = graph.start('play', str(short_bag), '--rate', RATE, '--loop')
    graph.wait_for(lambda: len(masks.messages) >= 6, node, looping)
    assert looping.stop() == 0
    round_ns = [START_NS + number * SECOND // 4 for number in range(4)]
    assert masks.stamps_ns[:6] == [*round_ns, *round_ns[:2]]

    masks.messages.clear()
    again = graph.start('play', str(short_bag), '--rate', RATE)
    graph.wait_for(lambda: masks.stamps_ns == round_ns, node)
    assert again.wait() == 0
    assert 'Traceback' not in node.output


def test_node_handles_simulated_time_that_jumps_back(
    graph: LiveGraph, node: Process, short_bag: Path
) -> None:
    masks = graph.subscribe('sensor_msgs/msg/Image', '/simulated/obstacle_mask')
    assert node.stop() == 0
    diagnostics = graph.diagnostics()
    names = ('left/image_rect', 'right/image_rect', 'left/camera_info', 'right/camera_info')
    remaps = [part for name in names for part in ('-r', f'{name}:=/stereo/{name}')]
    simulated = graph.start_node('-p', 'use_sim_time:=true', *remaps, namespace='simulated')
    graph.wait_until_listening('/stereo/left/image_rect', '/stereo/right/image_rect')

    player = graph.start('play', str(short_bag), '--rate', RATE, '--loop', '--clock')
    graph.wait_for(lambda: len(masks.messages) >= 6, simulated, player)

    assert masks.stamps_ns[4:6] == masks.stamps_ns[0:2]
    # Diagnostics continue and carry simulated time.
    before = diagnostics.count
    graph.wait_for(lambda: diagnostics.count > before + 1, simulated)
    assert START_NS <= diagnostics.stamps_ns[-1] <= START_NS + SECOND
    assert player.stop() == 0
    assert simulated.stop() == 0
