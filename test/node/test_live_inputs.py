"""Live inputs other than a plain pair with equal stamps."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import synthetic
from live_graph import FRAME, live_graph, message_type
from live_rover import SECOND, Rover

from rover_obstacle_detection import Detector, DetectorConfig, Gravity
from rover_obstacle_detection.messages.header import make_header

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
WIDER = synthetic.render(synthetic.hazard_camera(240, 180))


@pytest.fixture(scope='module')
def rover(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rover]:
    with live_graph(tmp_path_factory.mktemp('inputs')) as graph:
        yield Rover(graph)


@pytest.fixture
def calibrated(rover: Rover) -> Rover:
    rover.camera.wait_for_subscribers()
    rover.detect(VIEW)
    return rover


def expected_mask(gravity: Gravity | None = None, **parameters: Any) -> np.ndarray:
    detector = Detector(VIEW.scene.camera, DetectorConfig(**parameters))
    return detector.detect(VIEW.left, VIEW.right, gravity=gravity).mask


def test_changed_calibration_takes_effect(calibrated: Rover) -> None:
    np.testing.assert_array_equal(calibrated.detect(VIEW), expected_mask())

    wider = WIDER.scene.camera
    calibrated.camera.send_infos(wider, calibrated.next_stamp())
    calibrated.wait_for(lambda: 'camera: 240 x 180' in calibrated.process.output)
    expected = Detector(wider).detect(WIDER.left, WIDER.right).mask
    np.testing.assert_array_equal(calibrated.detect(WIDER), expected)

    calibrated.camera.send_infos(VIEW.scene.camera, calibrated.next_stamp())
    calibrated.wait_for(lambda: calibrated.process.output.count('camera: 320 x 240') == 2)
    np.testing.assert_array_equal(calibrated.detect(VIEW), expected_mask())


def test_16_bit_and_colour_images(calibrated: Rover) -> None:
    for array in (
        VIEW.left.astype(np.uint16) << 4,
        cv2.cvtColor(VIEW.left, cv2.COLOR_GRAY2BGR),
    ):
        stamp = calibrated.next_stamp()
        right = calibrated.camera.image(VIEW.right, stamp)
        left = calibrated.camera.image(array, stamp)
        calibrated.camera.send_images(left, right)
        expected = Detector(VIEW.scene.camera).detect(array, VIEW.right).mask
        np.testing.assert_array_equal(calibrated.wait_for_mask(stamp), expected)


def test_approximate_sync_pairs_unequal_stamps(calibrated: Rover) -> None:
    def send_unequal() -> int:
        stamp = calibrated.next_stamp()
        left = calibrated.camera.image(VIEW.left, stamp)
        right = calibrated.camera.image(VIEW.right, stamp + SECOND // 50)
        calibrated.camera.send_images(left, right)
        return stamp

    calibrated.set(approximate_sync=True, approximate_sync_tolerance_seconds=0.03)
    # The first pair may wait for the second and then be dropped in favour of it.
    sent = {send_unequal(), send_unequal()}
    calibrated.wait_for(lambda: sent & set(calibrated.mask.stamps_ns))
    (stamp, *_) = sent & set(calibrated.mask.stamps_ns)
    np.testing.assert_array_equal(calibrated.wait_for_mask(stamp), expected_mask())
    calibrated.set(approximate_sync=False)


def test_compressed_images(calibrated: Rover) -> None:
    calibrated.set(image_transport='compressed')
    publishers = [
        calibrated.graph.node.create_publisher(
            message_type('sensor_msgs/msg/CompressedImage'),
            f'/stereo/{side}/image_rect/compressed',
            10,
        )
        for side in ('left', 'right')
    ]
    calibrated.graph.wait_until_matched(*publishers)

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


def test_camera_that_is_mounted_upside_down(calibrated: Rover) -> None:
    turned = synthetic.render(VIEW.scene.with_(roll_deg=180.0))
    calibrated.set(upside_down=True)
    grid = calibrated.graph.subscribe('nav_msgs/msg/OccupancyGrid', '/stereo/obstacle_grid')

    config = DetectorConfig(upside_down=True)
    expected = Detector(turned.scene.camera, config).detect(turned.left, turned.right).mask
    assert synthetic.iou(expected, turned.obstacle) > 0.5
    np.testing.assert_array_equal(calibrated.detect(turned), expected)

    # A pair that cannot be judged has its grid below the camera too, which is up in the image.
    def unknown() -> list[Any]:
        # The subscription may be younger than the first pair.
        stamp = calibrated.next_stamp()
        dark = calibrated.camera.image(np.zeros_like(turned.left), stamp)
        calibrated.camera.send_images(dark, dark)
        return [each for each in grid.messages if set(each.data) == {-1}]

    calibrated.wait_for(unknown)
    assert unknown()[0].info.origin.position.x == -5.0
    calibrated.graph.unsubscribe(grid)
    calibrated.set(upside_down=False)


def test_gravity_from_an_imu(calibrated: Rover) -> None:
    calibrated.set(gravity_source='imu')
    imu = calibrated.graph.node.create_publisher(
        message_type('sensor_msgs/msg/Imu'), '/stereo/imu', 10
    )
    calibrated.graph.wait_until_matched(imu)
    calibrated.detect(VIEW)
    assert re.search(
        r'WARN.*/stereo/imu: no usable message within 200 ms.*gravity is estimated',
        calibrated.process.output,
    )

    # 25 degrees off, which makes level ground too steep and the mask different.
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

    def detected() -> bool:
        # The images may overtake the IMU message, so they are sent repeatedly.
        calibrated.camera.send(VIEW.scene.camera, VIEW.left, VIEW.right, stamp)
        return any(
            bytes(message.data) == expected.tobytes() for message in calibrated.mask.messages[-3:]
        )

    calibrated.graph.wait_for(detected)
    calibrated.set(gravity_source='estimate')
