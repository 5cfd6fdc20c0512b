"""What may come in besides two images with equal stamps: and what becomes of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import FRAME, Camera, LiveGraph, Process, Topic, live_graph

from rover_obstacle_detection import Detector, DetectorConfig, Gravity
from rover_obstacle_detection.messages.header import make_header

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
WIDER = synthetic.render(synthetic.hazard_camera(240, 180))
SECOND = 1_000_000_000
MASK = '/stereo/obstacle_mask'


class Rover:
    """A node with the given parameters, a camera before it, somebody who listens."""

    def __init__(self, graph: LiveGraph, *ros_arguments: str) -> None:
        self.graph = graph
        self.mask: Topic = graph.subscribe('sensor_msgs/msg/Image', MASK)
        self.diagnostics = graph.diagnostics()
        self.process: Process = graph.start_node(*ros_arguments)
        self.camera = Camera(graph)
        self._stamp = 1000 * SECOND

    def next_stamp(self) -> int:
        self._stamp += SECOND // 10
        return self._stamp

    def wait_for_mask(self, stamp: int) -> np.ndarray:
        self.graph.wait_for(lambda: stamp in self.mask.stamps_ns, self.process)
        message = self.mask.at(stamp)
        return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width)

    def answer(self, view: Any) -> np.ndarray:
        stamp = self.next_stamp()
        self.camera.send(view.scene.camera, view.left, view.right, stamp)
        return self.wait_for_mask(stamp)

    def set(self, **values: Any) -> None:
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter

        request = SetParametersAtomically.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
            ]
        )
        name = '/stereo/obstacle_detector/set_parameters_atomically'
        assert self.graph.call(SetParametersAtomically, name, request).result.successful


@pytest.fixture(scope='module')
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rover]:
    with live_graph(tmp_path_factory.mktemp('inputs')) as graph:
        yield Rover(graph)


@pytest.fixture
def calibrated(rover: Rover) -> Rover:
    rover.camera.wait_for_subscribers()
    rover.answer(VIEW)
    return rover


def expected_mask(gravity: Gravity | None = None, **parameters: Any) -> np.ndarray:
    detector = Detector(VIEW.scene.camera, DetectorConfig(**parameters))
    return detector.detect(VIEW.left, VIEW.right, gravity=gravity).mask


def test_says_what_it_waits_for_without_calibration(rover: Rover) -> None:
    rover.graph.wait_for(
        lambda: re.search(
            'WARN.*nothing came on /stereo/left/camera_info and /stereo/right/camera_info yet',
            rover.process.output,
        ),
        rover.process,
    )
    rover.graph.wait_for(lambda: rover.diagnostics.level('calibration') == 2, rover.process)
    assert 'no calibration' in rover.diagnostics.message('calibration')


def test_second_camera_with_another_calibration(calibrated: Rover) -> None:
    np.testing.assert_array_equal(calibrated.answer(VIEW), expected_mask())

    wider = WIDER.scene.camera
    calibrated.camera.send_infos(wider, calibrated.next_stamp())
    calibrated.graph.wait_for(
        lambda: 'camera: 240 x 180' in calibrated.process.output, calibrated.process
    )
    expected = Detector(wider).detect(WIDER.left, WIDER.right).mask
    np.testing.assert_array_equal(calibrated.answer(WIDER), expected)

    calibrated.camera.send_infos(VIEW.scene.camera, calibrated.next_stamp())
    calibrated.graph.wait_for(
        lambda: calibrated.process.output.count('camera: 320 x 240') == 2, calibrated.process
    )
    np.testing.assert_array_equal(calibrated.answer(VIEW), expected_mask())


def test_16_bit_and_colour_images(calibrated: Rover) -> None:
    for array in (
        VIEW.left.astype(np.uint16) << 4,
        cv2.cvtColor(VIEW.left, cv2.COLOR_GRAY2BGR),
    ):
        stamp = calibrated.next_stamp()
        right = calibrated.camera.image(VIEW.right, stamp)
        left = calibrated.camera.image(array, stamp)
        calibrated.camera.send_images(left, right)
        assert calibrated.wait_for_mask(stamp).shape == VIEW.scene.camera.shape


def test_stamps_that_never_match_are_named_and_approximate_sync_mends_it(
    calibrated: Rover,
) -> None:
    def send_unequal() -> int:
        stamp = calibrated.next_stamp()
        left = calibrated.camera.image(VIEW.left, stamp)
        right = calibrated.camera.image(VIEW.right, stamp + SECOND // 50)
        calibrated.camera.send_images(left, right)
        return stamp

    # Older pairs were exact, and the smallest gap is since the settings last changed.
    calibrated.set(queue_size=4)

    def named() -> Any:
        send_unequal()
        return re.search(
            r'WARN.*\d+ left, \d+ right, 0 pairs, smallest gap 20\.0 ms; try approximate_sync',
            calibrated.process.output,
        )

    calibrated.graph.wait_for(named, calibrated.process)
    calibrated.graph.wait_for(
        lambda: (
            send_unequal()
            and 'try approximate_sync' in calibrated.diagnostics.message('stereo input')
        ),
        calibrated.process,
    )

    calibrated.set(approximate_sync=True, approximate_sync_tolerance_seconds=0.03)
    # The first of two pairs may have to wait for the second, and then be dropped for it.
    sent = {send_unequal(), send_unequal()}
    calibrated.graph.wait_for(lambda: sent & set(calibrated.mask.stamps_ns), calibrated.process)
    (stamp, *_) = sent & set(calibrated.mask.stamps_ns)
    np.testing.assert_array_equal(calibrated.wait_for_mask(stamp), expected_mask())
    calibrated.set(approximate_sync=False)


def test_compressed_images(calibrated: Rover) -> None:
    from live_graph import message_type

    calibrated.set(image_transport='compressed')
    publishers = [
        calibrated.graph.node.create_publisher(
            message_type('sensor_msgs/msg/CompressedImage'),
            f'/stereo/{side}/image_rect/compressed',
            10,
        )
        for side in ('left', 'right')
    ]
    calibrated.graph.wait_for(lambda: all(each.get_subscription_count() for each in publishers))

    stamp = calibrated.next_stamp()
    for publisher, array in zip(publishers, (VIEW.left, VIEW.right), strict=True):
        _, data = cv2.imencode('.png', array)
        publisher.publish(
            calibrated.graph.factory.make(
                'sensor_msgs/msg/CompressedImage',
                header=make_header(stamp, FRAME, calibrated.graph.factory),
                format='png',
                data=data.reshape(-1),
            )
        )

    np.testing.assert_array_equal(calibrated.wait_for_mask(stamp), expected_mask())
    calibrated.set(image_transport='raw')
    calibrated.camera.wait_for_subscribers()


def test_vertical_from_an_imu(calibrated: Rover) -> None:
    from live_graph import message_type

    calibrated.set(gravity_source='imu')
    imu = calibrated.graph.node.create_publisher(
        message_type('sensor_msgs/msg/Imu'), '/stereo/imu', 10
    )
    calibrated.graph.wait_for(imu.get_subscription_count)
    calibrated.answer(VIEW)
    assert re.search(
        r'WARN.*/stereo/imu: no usable message within 200 ms.*gravity is estimated',
        calibrated.process.output,
    )

    # So far off the truth that level ground is too steep: not to be mistaken for the estimate.
    up = Gravity.from_angles(46.0 - 25.0).up
    stamp = calibrated.next_stamp()
    factory = calibrated.graph.factory
    no_orientation = np.zeros(9)
    no_orientation[0] = -1
    imu.publish(
        factory.make(
            'sensor_msgs/msg/Imu',
            header=make_header(stamp, 'imu', factory),
            orientation_covariance=no_orientation,
            linear_acceleration=factory.make(
                'geometry_msgs/msg/Vector3',
                **{axis: 3.7 * value for axis, value in zip('xyz', up, strict=True)},
            ),
        )
    )
    expected = expected_mask(Gravity(up=up), gravity_source='imu')
    assert not np.array_equal(expected, expected_mask())

    def answered() -> bool:
        # The two topics are not ordered: the images may overtake the IMU.
        calibrated.camera.send(VIEW.scene.camera, VIEW.left, VIEW.right, stamp)
        return any(
            bytes(message.data) == expected.tobytes() for message in calibrated.mask.messages[-3:]
        )

    calibrated.graph.wait_for(answered, calibrated.process)
    calibrated.set(gravity_source='estimate')
