"""A camera whose driver publishes raw images only."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import cv2
import synthetic
from hand_made import stereo_images, write_stereo_bag
from live_graph import Camera, live_graph
from live_rover import Rover

from rover_obstacle_detection import Detector
from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.cli.main import main
from rover_obstacle_detection.messages.calibration import CameraInfo
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.rectification import Rectification

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
CAMERA = VIEW.scene.camera
REMAPPED = [
    part for side in ('left', 'right') for part in ('-r', f'{side}/image_rect:={side}/image_raw')
]
NAMES = '/stereo/left/image_raw and /stereo/right/image_raw'
# Of a wide-angle lens: at the corners, several pixels.
BENT = (-0.12, 0.03, 0.001, -0.001, 0.0)
RATIONAL = (0.05, -0.02, 0.0, 0.0, 0.001, 0.15, -0.02, 0.002)
TILT = cv2.Rodrigues(np.array([0.01, -0.02, 0.005]))[0].reshape(-1)


class RawRover(Rover):
    """Its camera sends raw images, and calibrations that say how to rectify them."""

    def infos(self, **changes: Any) -> tuple[Any, Any]:
        """CameraInfo of both sides; without changes, of a lens without distortion."""
        stamp = self.next_stamp()
        k = (CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1)
        fields = {'distortion_model': 'plumb_bob', 'd': (), 'k': k, 'r': np.identity(3).ravel()}
        infos = []
        for side in ('left', 'right'):
            info = self.camera.info(CAMERA, side, stamp)
            for name, value in (fields | changes).items():
                is_text = isinstance(value, str)
                setattr(info, name, value if is_text else np.array(value, np.float64))
            infos.append(info)
        return infos[0], infos[1]

    def send_raw_infos(self, infos: tuple[Any, Any]) -> None:
        for side, info in zip(('left', 'right'), infos, strict=True):
            self.camera.publishers[side, 'camera_info'].publish(info)

    def detect_raw(self) -> np.ndarray:
        """Send the pair; return its mask."""
        stamp = self.next_stamp()
        images = (self.camera.image(image, stamp) for image in (VIEW.left, VIEW.right))
        self.camera.send_images(*images)
        return self.wait_for_mask(stamp)

    def logged(self, words: str, times: int = 1) -> None:
        self.wait_for(lambda: self.process.output.count(words) == times)


@pytest.fixture
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RawRover]:
    with live_graph(tmp_path_factory.mktemp('raw')) as graph:
        rover = RawRover(graph, *REMAPPED, camera=Camera(graph, image='image_raw'))
        rover.camera.wait_for_subscribers()
        yield rover


def expected_mask(infos: tuple[Any, Any]) -> np.ndarray:
    left, right = (
        Rectification(CameraInfo.from_message(info), 'info')(image)
        for info, image in zip(infos, (VIEW.left, VIEW.right), strict=True)
    )
    return Detector(CAMERA).detect(left, right).mask


def test_raw_images_are_rectified_as_camera_info_says_and_changes_take_effect(
    rover: RawRover,
) -> None:
    outputs = rover.graph.subscribe('sensor_msgs/msg/CameraInfo', '/stereo/camera_info')
    bent = rover.infos(d=BENT, r=TILT)
    rover.send_raw_infos(bent)
    rover.logged(f'{NAMES} are raw images: rectifying them with K, D, R and P')
    mask = rover.detect_raw()
    np.testing.assert_array_equal(mask, expected_mask(bent))
    plain = Detector(CAMERA).detect(VIEW.left, VIEW.right).mask
    assert not np.array_equal(mask, plain)
    rover.wait_for(lambda: rover.diagnostics.value('calibration', 'images').startswith(NAMES))

    # The published camera is that of the mask.
    rover.wait_for(lambda: outputs.messages)
    (published, *_) = outputs.messages
    assert published.header == rover.mask.messages[0].header
    assert (list(published.d), list(published.k)) == ([0.0] * 5, list(bent[0].k))
    np.testing.assert_array_equal(published.p, bent[0].p)

    rational = rover.infos(distortion_model='rational_polynomial', d=RATIONAL, r=TILT)
    rover.send_raw_infos(rational)
    rover.logged('are raw images: rectifying', times=3)
    np.testing.assert_array_equal(rover.detect_raw(), expected_mask(rational))


def test_raw_images_without_distortion_are_used_with_a_warning(rover: RawRover) -> None:
    rover.send_raw_infos(rover.infos())

    rover.logged('but there is no distortion or rotation in')
    expected = Detector(CAMERA).detect(VIEW.left, VIEW.right).mask
    np.testing.assert_array_equal(rover.detect_raw(), expected)


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'k': (0.0,) * 9}, 'K is (0.0'),
        ({'distortion_model': 'fov', 'd': (0.9,)}, "distortion_model is 'fov'"),
    ],
)
def test_raw_images_that_cannot_be_rectified_are_named_until_they_can(
    rover: RawRover, changes: dict[str, Any], words: str
) -> None:
    rover.send_raw_infos(rover.infos(**changes))
    problem = f'{NAMES} are raw images and cannot be rectified: '
    rover.wait_for(lambda: rover.diagnostics.message('calibration').startswith(problem))
    assert words in rover.diagnostics.message('calibration')
    assert rover.diagnostics.level('calibration') == 2
    assert not rover.mask.messages

    # The user can say that they are rectified.
    rover.set(rectify='never')
    plain = Detector(CAMERA).detect(VIEW.left, VIEW.right).mask
    np.testing.assert_array_equal(rover.detect_raw(), plain)
    rover.set(rectify='by_name')

    bent = rover.infos(d=BENT)
    rover.send_raw_infos(bent)
    rover.logged('are raw images: rectifying')
    np.testing.assert_array_equal(rover.detect_raw(), expected_mask(bent))


def test_rectified_images_are_not_rectified_again(tmp_path: Path) -> None:
    with live_graph(tmp_path) as graph:
        rover = RawRover(graph)
        rover.camera.wait_for_subscribers()
        bent = rover.infos(d=BENT, r=TILT)
        rover.send_raw_infos(bent)
        rover.logged('camera: 320 x 240')
        plain = Detector(CAMERA).detect(VIEW.left, VIEW.right).mask
        np.testing.assert_array_equal(rover.detect_raw(), plain)
        rover.wait_for(lambda: rover.diagnostics.value('calibration', 'images') == 'rectified')

        rover.logged('are taken as rectified')

        rover.set(rectify='always')
        rover.logged('are raw images: rectifying them with K, D, R and P')
        np.testing.assert_array_equal(rover.detect_raw(), expected_mask(bent))


def test_node_and_replay_rectify_a_recording_alike(tmp_path: Path) -> None:
    def bend(side: str, info: Any) -> None:
        info.d, info.r = np.array(BENT), TILT

    bag = write_stereo_bag(
        tmp_path / 'raw', 2, images=[stereo_images()], name='image_raw', change_info=bend
    )
    assert main(['replay', str(bag), '-o', str(tmp_path / 'out')]) == 0
    with open_bag(tmp_path / 'out' / 'detections') as detections:
        replayed = {
            stamp_ns(message.header): bytes(message.data)
            for _, _, message in detections.messages(['/cam/obstacle_mask'])
        }
    assert len(replayed) == 2

    with live_graph(tmp_path) as graph:
        masks = graph.subscribe('sensor_msgs/msg/Image', '/cam/obstacle_mask')
        node = graph.start('run', '--namespace', 'cam', '--camera', 'raw')
        graph.wait_until_listening('/cam/left/image_raw', '/cam/right/image_raw')
        graph.start('play', str(bag), '--rate', '0.1')
        graph.wait_for(lambda: len(masks.messages) == 2, node)

    assert {stamp_ns(each.header): bytes(each.data) for each in masks.messages} == replayed
