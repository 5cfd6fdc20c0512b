"""Live faults, each followed by a good pair: the fault is named and counted, the pair detected."""

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
from live_faults import set_field, shrink, truncate
from live_graph import live_graph
from live_rover import Rover

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
CAMERA = VIEW.scene.camera


class FaultyRover(Rover):
    sent_bad = 0

    def send_bad(self, left: Any, right: Any) -> None:
        self.sent_bad += 1
        self.camera.send_images(left, right)

    def expect_warning(self, pattern: str) -> None:
        self.wait_for(lambda: re.search(f'WARN.*{pattern}', self.process.output))

    def expect_count(self) -> None:
        self.wait_for(
            lambda: self.diagnostics.value('detection', 'bad frames') == str(self.sent_bad)
        )

    def expect_detection_of_good_pair(self) -> None:
        assert synthetic.iou(self.detect(VIEW), VIEW.obstacle) > 0.5


@pytest.fixture(scope='module')
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FaultyRover]:
    with live_graph(tmp_path_factory.mktemp('faults')) as graph:
        rover = FaultyRover(graph)
        rover.camera.wait_for_subscribers()
        rover.expect_detection_of_good_pair()
        yield rover


@pytest.mark.parametrize(
    ('side', 'spoil', 'field'),
    [
        ('left', set_field('step', 7), 'step'),
        ('right', set_field('encoding', 'yuv9'), 'encoding'),
        ('left', truncate, 'data'),
        ('right', truncate, 'data'),
        ('left', shrink, 'width'),
    ],
)
def test_image_with_an_invalid_field(
    rover: FaultyRover, side: str, spoil: Any, field: str
) -> None:
    left, right = rover.images(VIEW)
    spoil(left if side == 'left' else right)

    rover.send_bad(left, right)

    rover.expect_warning(rf'/stereo/{side}/image_rect.*{field}.*expected')
    rover.expect_detection_of_good_pair()


def test_image_without_stamp(rover: FaultyRover) -> None:
    left, right = rover.images(VIEW)
    left.header.stamp.sec, left.header.stamp.nanosec = 0, 0

    rover.send_bad(left, right)

    rover.expect_warning(r'/stereo/left/image_rect: header\.stamp is zero')
    rover.expect_detection_of_good_pair()


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'p': np.zeros(12)}, r'P\[0\] \(fx\) is 0\.0'),
        ({'p': np.full(12, math.nan)}, 'not finite'),
        ({'width': 0}, 'size is 0 x 240'),
        ({'width': 640}, '640 x 240'),
    ],
)
def test_invalid_calibration(rover: FaultyRover, changes: dict[str, Any], reason: str) -> None:
    info = rover.camera.info(CAMERA, 'left', rover.next_stamp())
    for name, value in changes.items():
        setattr(info, name, value)
    rover.camera.publishers['left', 'camera_info'].publish(info)
    rover.expect_warning(f'/stereo/left/camera_info.*{reason}')

    rover.send_bad(*rover.images(VIEW))

    rover.expect_count()
    rover.expect_detection_of_good_pair()


def test_calibration_of_another_size_than_the_image(rover: FaultyRover) -> None:
    other = dataclasses.replace(CAMERA, width=200)
    rover.camera.send_infos(other, rover.next_stamp())
    rover.wait_for(lambda: 'camera: 200 x 240' in rover.process.output)

    rover.send_bad(*rover.images(VIEW))

    rover.expect_warning(
        '/stereo/left/image_rect: width x height is 320 x 240: expected 200 x 240'
    )
    rover.expect_detection_of_good_pair()


def test_left_and_right_swapped(rover: FaultyRover) -> None:
    left, right = rover.images(VIEW)

    rover.send_bad(right, left)

    rover.expect_warning('/stereo/left/image_rect, /stereo/right/image_rect: .*swapped')
    rover.expect_detection_of_good_pair()


def test_repeated_fault_is_logged_once_in_ten_seconds(rover: FaultyRover) -> None:
    for _ in range(3):
        left, right = rover.images(VIEW)
        left.encoding = 'nonsense'
        rover.send_bad(left, right)
        rover.expect_count()
        rover.expect_detection_of_good_pair()

    assert rover.process.output.count("encoding is 'nonsense'") == 1
    rover.wait_for(
        lambda: rover.diagnostics.message('detection').endswith('detections per second')
    )
