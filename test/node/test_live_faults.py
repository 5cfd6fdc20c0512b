"""Each fault sent live, then a good pair: named, counted, and the good pair answered."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import Camera, LiveGraph, live_graph

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
CAMERA = VIEW.scene.camera
SECOND = 1_000_000_000


class Rover:
    """The node, a camera before it, and somebody who listens to the mask."""

    def __init__(self, graph: LiveGraph) -> None:
        self.graph = graph
        self.mask = graph.subscribe('sensor_msgs/msg/Image', '/stereo/obstacle_mask')
        self.diagnostics = graph.diagnostics()
        self.process = graph.start_node()
        self.camera = Camera(graph)
        self.camera.wait_for_subscribers()
        self.sent_bad = 0
        self._stamp = 1000 * SECOND

    def next_stamp(self) -> int:
        self._stamp += SECOND // 10
        return self._stamp

    def bad_frames(self) -> int:
        return int(self.diagnostics.value('detection', 'bad frames', '0'))

    def images(self) -> tuple[Any, Any]:
        stamp = self.next_stamp()
        return self.camera.image(VIEW.left, stamp), self.camera.image(VIEW.right, stamp)

    def send_bad(self, left: Any, right: Any) -> None:
        self.sent_bad += 1
        self.camera.send_images(left, right)

    def expect_warning(self, pattern: str) -> None:
        self.graph.wait_for(lambda: re.search(pattern, self.process.output), self.process)

    def expect_count(self) -> None:
        self.graph.wait_for(lambda: self.bad_frames() == self.sent_bad, self.process)

    def expect_answer_to_good_pair(self) -> None:
        stamp = self.next_stamp()
        self.camera.send(CAMERA, VIEW.left, VIEW.right, stamp)
        self.graph.wait_for(lambda: stamp in self.mask.stamps_ns, self.process)
        mask = np.frombuffer(self.mask.at(stamp).data, np.uint8).reshape(CAMERA.shape)
        assert synthetic.iou(mask, VIEW.obstacle) > 0.5


@pytest.fixture(scope='module')
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rover]:
    with live_graph(tmp_path_factory.mktemp('faults')) as graph:
        rover = Rover(graph)
        rover.expect_answer_to_good_pair()
        yield rover


def set_field(name: str, value: object) -> Any:
    return lambda image: setattr(image, name, value)


def cut_data(image: Any) -> None:
    image.data = image.data[:1000]


def shrink(image: Any) -> None:
    image.width, image.height, image.step = 160, 120, 160
    image.data = image.data[: 160 * 120]


@pytest.mark.parametrize(
    ('side', 'spoil', 'field'),
    [
        ('left', set_field('step', 7), 'step'),
        ('right', set_field('encoding', 'yuv9'), 'encoding'),
        ('left', cut_data, 'data'),
        ('right', cut_data, 'data'),
        ('left', shrink, 'width'),
    ],
)
def test_image_with_a_wrong_field(rover: Rover, side: str, spoil: Any, field: str) -> None:
    left, right = rover.images()
    spoil(left if side == 'left' else right)

    rover.send_bad(left, right)

    rover.expect_warning(rf'WARN.*/stereo/{side}/image_rect.*{field}.*expected')
    rover.expect_answer_to_good_pair()


def test_image_without_stamp(rover: Rover) -> None:
    left, right = rover.images()
    left.header.stamp.sec, left.header.stamp.nanosec = 0, 0

    rover.send_bad(left, right)

    rover.expect_warning(r'WARN.*/stereo/left/image_rect: header\.stamp is zero')
    rover.expect_answer_to_good_pair()


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'p': np.zeros(12)}, r'P\[0\] \(fx\) is 0\.0'),
        ({'p': np.full(12, math.nan)}, 'not finite'),
        ({'width': 0}, 'size is 0 x 240'),
        ({'width': 640}, '640 x 240'),
    ],
)
def test_calibration_that_is_none(rover: Rover, changes: dict[str, Any], reason: str) -> None:
    stamp = rover.next_stamp()
    info = rover.camera.info(CAMERA, 'left', stamp)
    for name, value in changes.items():
        setattr(info, name, value)
    rover.camera.publishers['left', 'camera_info'].publish(info)
    rover.graph.wait_for(
        lambda: re.search(f'WARN.*/stereo/left/camera_info.*{reason}', rover.process.output),
        rover.process,
    )

    rover.send_bad(*rover.images())

    rover.expect_count()
    rover.expect_answer_to_good_pair()


def test_calibration_that_contradicts_the_image(rover: Rover) -> None:
    other = dataclasses.replace(CAMERA, width=200)
    rover.camera.send_infos(other, rover.next_stamp())
    rover.graph.wait_for(lambda: 'camera: 200 x 240' in rover.process.output, rover.process)

    rover.send_bad(*rover.images())

    rover.expect_warning(
        'WARN.*/stereo/left/image_rect: width x height is 320 x 240: expected 200 x 240'
    )
    rover.expect_answer_to_good_pair()


def test_left_and_right_swapped(rover: Rover) -> None:
    left, right = rover.images()

    rover.send_bad(right, left)

    rover.expect_warning('WARN.*disparities are negative.*left and right swapped')
    rover.expect_answer_to_good_pair()


def test_each_kind_of_fault_is_said_once_in_ten_seconds(rover: Rover) -> None:
    for _ in range(3):
        left, right = rover.images()
        left.encoding = 'nonsense'
        rover.send_bad(left, right)
        rover.expect_count()
        rover.expect_answer_to_good_pair()

    assert rover.process.output.count("encoding is 'nonsense'") == 1


def test_every_fault_was_counted(rover: Rover) -> None:
    rover.expect_count()
    rover.expect_answer_to_good_pair()
    rover.graph.wait_for(
        lambda: rover.diagnostics.message('detection').endswith('detections per second'),
        rover.process,
    )

    assert rover.bad_frames() == rover.sent_bad
