"""Gravity from IMU messages and from TF."""

from __future__ import annotations

import math
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.node.imu_gravity import ImuGravity

SECOND = 1_000_000_000


def make_imu(
    stamp_ns: int,
    acceleration: tuple[float, float, float] = (0.0, 0.0, 0.0),
    orientation: tuple[float, float, float, float] | None = None,
) -> Any:
    x, y, z, w = orientation or (0.0, 0.0, 0.0, 0.0)
    return SimpleNamespace(
        header=SimpleNamespace(
            stamp=SimpleNamespace(sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
        ),
        orientation=SimpleNamespace(x=x, y=y, z=z, w=w),
        orientation_covariance=[-1.0 if orientation is None else 0.0] + [0.0] * 8,
        linear_acceleration=SimpleNamespace(
            x=acceleration[0], y=acceleration[1], z=acceleration[2]
        ),
        linear_acceleration_covariance=[0.0] * 9,
    )


@pytest.mark.parametrize('gravity_m_s2', [9.81, 3.71, 1.62])
def test_acceleration_at_rest_gives_up_on_any_planet(gravity_m_s2: float) -> None:
    up = Gravity.from_angles(30.0, 5.0).up
    imu = ImuGravity((0.0, 0.0, 0.0))

    assert imu.add(make_imu(SECOND, tuple(gravity_m_s2 * each for each in up))) is None

    found = imu.at(SECOND, 1.2)
    assert found is not None
    assert found.up == pytest.approx(up)
    assert found.height_m == 1.2


def test_mounting_angles_rotate_the_imu_frame() -> None:
    # Body axes (x forward, y left, z up) in a level optical frame (z forward).
    imu = ImuGravity((90.0, -90.0, 0.0))

    imu.add(make_imu(SECOND, (0.0, 0.0, 9.81)))

    found = imu.at(SECOND, None)
    assert found is not None
    assert found.up == pytest.approx(Gravity.from_angles(0.0).up, abs=1e-12)


def test_orientation_is_preferred_to_acceleration() -> None:
    half = math.radians(20.0) / 2
    imu = ImuGravity((0.0, 0.0, 0.0))

    imu.add(make_imu(SECOND, (9.0, 0.0, 0.0), (math.sin(half), 0.0, 0.0, math.cos(half))))

    found = imu.at(SECOND, None)
    assert found is not None
    # Rotated by 20 degrees about x, so up leans towards y in the IMU frame.
    angle = math.radians(20.0)
    assert found.up == pytest.approx((0.0, math.sin(angle), math.cos(angle)))


def test_acceleration_is_smoothed() -> None:
    imu = ImuGravity((0.0, 0.0, 0.0))
    shake = np.random.default_rng(1).normal(0, 3.0, (200, 3))
    for number, (x, y, z) in enumerate(shake):
        imu.add(make_imu(SECOND + number * SECOND // 100, (x, y - 9.81, z)))

    found = imu.at(3 * SECOND, None)
    assert found is not None
    assert math.degrees(math.acos(-found.up[1])) < 8.0


def test_nearest_message_within_200_ms_is_used() -> None:
    imu = ImuGravity((0.0, 0.0, 0.0))
    identity, upside_down = (0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0)
    imu.add(make_imu(1 * SECOND, orientation=identity))
    imu.add(make_imu(2 * SECOND, orientation=upside_down))

    def z_at(stamp_ns: int) -> float | None:
        found = imu.at(stamp_ns, None)
        return None if found is None else found.up[2]

    assert z_at(SECOND + SECOND // 10) == pytest.approx(1.0)
    assert z_at(2 * SECOND - SECOND // 10) == pytest.approx(-1.0)
    assert z_at(SECOND + SECOND // 2) is None
    assert ImuGravity((0.0, 0.0, 0.0)).at(SECOND, None) is None


def test_jump_back_in_time_discards_later_messages() -> None:
    imu = ImuGravity((0.0, 0.0, 0.0))
    imu.add(make_imu(100 * SECOND, orientation=(0.0, 0.0, 0.0, 1.0)))

    imu.add(make_imu(10 * SECOND, orientation=(0.0, 0.0, 0.0, 1.0)))

    assert imu.at(100 * SECOND, None) is None
    assert imu.at(10 * SECOND, None) is not None


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (make_imu(SECOND, (math.nan, 0.0, 9.8)), 'neither a unit orientation nor'),
        (make_imu(SECOND), 'linear_acceleration is zero'),
        (make_imu(SECOND, (math.inf, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0)), 'neither'),
    ],
)
def test_message_without_a_direction_is_refused(message: Any, reason: str) -> None:
    imu = ImuGravity((0.0, 0.0, 0.0))

    problem = imu.add(message)

    assert problem is not None
    assert reason in problem
    assert imu.at(SECOND, None) is None


class TransformError(Exception):
    """Replaces tf2_ros.TransformException."""


@pytest.fixture
def tf2_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fake tf2_ros with one transform, from camera to base_link."""
    pytest.importorskip('rclpy', reason='needs ROS 2')

    class Buffer:
        def lookup_transform(self, target: str, source: str, stamp: Any, timeout: Any) -> Any:
            if (target, source) != ('base_link', 'camera'):
                msg = f'{source} does not exist'
                raise TransformError(msg)
            # Optical axes to body axes of a level camera.
            rotation = SimpleNamespace(x=-0.5, y=0.5, z=-0.5, w=0.5)
            return SimpleNamespace(transform=SimpleNamespace(rotation=rotation))

    class TransformListener:
        def __init__(self, buffer: Buffer, node: object) -> None:
            pass

        def unregister(self) -> None:
            pass

    module = ModuleType('tf2_ros')
    vars(module).update(
        Buffer=Buffer, TransformListener=TransformListener, TransformException=TransformError
    )
    monkeypatch.setitem(sys.modules, 'tf2_ros', module)


@pytest.mark.usefixtures('tf2_ros')
def test_gravity_from_tf() -> None:
    from rover_obstacle_detection.node.tf_gravity import TfGravity

    tf = TfGravity(object(), 'base_link')

    found = tf.at(None, 'camera', 0.9)
    assert isinstance(found, Gravity)
    assert found.up == pytest.approx(Gravity.from_angles(0.0).up, abs=1e-12)
    assert found.height_m == 0.9
    problem = tf.at(None, 'elsewhere', None)
    assert problem == "no transform from 'elsewhere' to 'base_link': elsewhere does not exist"
    tf.close()
