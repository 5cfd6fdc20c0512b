"""A watched rover whose camera, network and operator make mistakes."""

from __future__ import annotations

import dataclasses
import re
import signal
import time
from collections.abc import Callable, Iterator
from typing import Any

import degrade
import numpy as np
import synthetic
from live_graph import LiveGraph, message_type
from live_rover import SECOND, Rover

VIEW = synthetic.render(synthetic.mast(solids=(synthetic.Box(0.0, 1.0, 0.3, 0.3, 0.25),)))
CAMERA = VIEW.scene.camera
LEVELS = {'OK': 0, 'WARN': 1, 'ERROR': 2}
PERIOD_S = 0.1
MS = 1_000_000

Injection = Callable[['FaultyRover'], Iterator[None]]
"""Injects a fault at each step; what follows the last step ends it."""


class FaultyRover(Rover):
    def __init__(self, graph: LiveGraph) -> None:
        self._exposures = 0
        super().__init__(graph, '-p', 'frozen_after:=5', watchdog=True)
        self.camera.wait_for_subscribers()

    def exposure(self) -> tuple[np.ndarray, np.ndarray]:
        self._exposures += 1
        view = synthetic.exposed_again(VIEW, seed=self._exposures)
        return view.left, view.right

    def pair(self, right_later_ns: int = 0) -> tuple[Any, Any]:
        """Messages of a new exposure with a new stamp."""
        left, right = self.exposure()
        stamp = self.next_stamp()
        return self.camera.image(left, stamp), self.camera.image(right, stamp + right_later_ns)

    def skip(self, seconds: int) -> None:
        self._stamp += seconds * SECOND

    def see(self, fault: Any) -> None:
        """Inject a fault until log and diagnostics say so, then end it."""
        steps, due_s = fault.inject(self), time.monotonic()

        def seen() -> bool:
            nonlocal due_s
            if time.monotonic() >= due_s:
                next(steps, None)
                due_s = time.monotonic() + PERIOD_S
            return bool(
                re.search(f'{fault.logged}.*{fault.pattern}', self.process.output)
                and re.search(fault.pattern, self.diagnostics.message(fault.status))
                and self.diagnostics.level(fault.status) == LEVELS[fault.level]
            )

        try:
            self.wait_for(seen)
        finally:
            steps.close()

    def see_good_pair(self) -> None:
        """Send good pairs until one is judged; images may overtake a changed calibration."""
        sent: set[int] = set()
        due_s = time.monotonic()

        def judged() -> set[int]:
            nonlocal due_s
            if time.monotonic() >= due_s:
                sent.add(self.send_good())
                due_s = time.monotonic() + 1.0
            return sent & set(self.mask.stamps_ns)

        self.wait_for(judged)
        mask = self.wait_for_mask(judged().pop())
        assert synthetic.iou(mask, VIEW.obstacle) > 0.5

    def send_good(self) -> int:
        stamp = self.next_stamp()
        self.camera.send(CAMERA, *self.exposure(), stamp)
        return stamp


def spoilt(side: str, spoil: Callable[[Any], None]) -> Injection:
    """Images of one camera are spoilt."""

    def inject(rover: FaultyRover) -> Iterator[None]:
        while True:
            pair = dict(zip(('left', 'right'), rover.pair(), strict=True))
            spoil(pair[side])
            rover.camera.send_images(*pair.values())
            yield

    return inject


def swapped(rover: FaultyRover) -> Iterator[None]:
    while True:
        rover.camera.send_images(*reversed(rover.pair()))
        yield


def covered(rover: FaultyRover) -> Iterator[None]:
    left, right = degrade.covered(VIEW.left, VIEW.right)
    lenses, seed = dataclasses.replace(VIEW, left=left, right=right), 0
    while True:
        seed += 1
        view = synthetic.exposed_again(lenses, seed)
        rover.camera.send(CAMERA, view.left, view.right, rover.next_stamp())
        yield


def bad_info(**fields: Any) -> Injection:
    """The calibration of the left camera has wrong fields."""

    def inject(rover: FaultyRover) -> Iterator[None]:
        while True:
            info = rover.camera.info(CAMERA, 'left', rover.next_stamp())
            for name, value in fields.items():
                setattr(info, name, value)
            rover.camera.publishers['left', 'camera_info'].publish(info)
            yield

    return inject


def upside_down(rover: FaultyRover) -> Iterator[None]:
    while True:
        stamp = rover.next_stamp()
        images = degrade.upside_down(*rover.exposure())
        rover.camera.send(CAMERA, *(np.ascontiguousarray(each) for each in images), stamp)
        yield


def upright(rover: FaultyRover) -> Iterator[None]:
    rover.set(upside_down=True)
    try:
        while True:
            rover.camera.send(CAMERA, *rover.exposure(), rover.next_stamp())
            yield
    finally:
        rover.set(upside_down=False)


def raw_images(**fields: Any) -> Injection:
    """Rectify the images, with these values in the calibration of both cameras."""

    def inject(rover: FaultyRover) -> Iterator[None]:
        rover.set(rectify='always')
        try:
            while True:
                stamp = rover.next_stamp()
                for side in ('left', 'right'):
                    info = rover.camera.info(CAMERA, side, stamp)
                    for name, value in fields.items():
                        setattr(info, name, value)
                    rover.camera.publishers[side, 'camera_info'].publish(info)
                yield
        finally:
            rover.set(rectify='by_name')

    return inject


def other_camera(rover: FaultyRover) -> Iterator[None]:
    while True:
        rover.camera.send_infos(dataclasses.replace(CAMERA, width=200), rover.next_stamp())
        rover.camera.send_images(*rover.pair())
        yield


def tiny_camera(rover: FaultyRover) -> Iterator[None]:
    tiny = dataclasses.replace(CAMERA, width=8, height=8, cx=3.5, cy=3.5, cx_right=3.5)
    while True:
        images = (image[:8, :8].copy() for image in rover.exposure())
        rover.camera.send(tiny, *images, rover.next_stamp())
        yield


def no_info(rover: FaultyRover) -> Iterator[None]:
    for name in ('deactivate', 'cleanup', 'configure', 'activate'):
        rover.transition(name)
    rover.camera.wait_for_subscribers()
    while True:
        rover.camera.send_images(*rover.pair())
        yield


def frozen(rover: FaultyRover) -> Iterator[None]:
    still, _ = rover.exposure()
    while True:
        rover.camera.send(CAMERA, still, rover.exposure()[1], rover.next_stamp())
        yield


def repeated_stamp(rover: FaultyRover) -> Iterator[None]:
    stamp = rover.next_stamp()
    while True:
        rover.camera.send(CAMERA, *rover.exposure(), stamp)
        yield


def silent(rover: FaultyRover) -> Iterator[None]:
    while True:
        yield


def one_camera(rover: FaultyRover) -> Iterator[None]:
    publishers = rover.camera.publishers
    rover.graph.node.destroy_publisher(publishers['right', 'image_rect'])
    try:
        while True:
            publishers['left', 'image_rect'].publish(rover.pair()[0])
            yield
    finally:
        publishers['right', 'image_rect'] = rover.camera.create('right', 'image_rect')
        rover.camera.wait_for_subscribers()


def late(rover: FaultyRover) -> Iterator[None]:
    while True:
        rover.camera.send(CAMERA, *rover.exposure(), time.time_ns() - 5 * SECOND)
        yield


def unequal_stamps(later_ms: int, spacing_s: int) -> Injection:
    """The right image is later than the left one."""

    def inject(rover: FaultyRover) -> Iterator[None]:
        while True:
            rover.skip(spacing_s)
            rover.camera.send_images(*rover.pair(right_later_ns=later_ms * MS))
            yield

    return inject


def approximate_sync_without_limit(rover: FaultyRover) -> Iterator[None]:
    rover.set(approximate_sync=True)
    try:
        yield from unequal_stamps(later_ms=700, spacing_s=2)(rover)
    finally:
        rover.set(approximate_sync=False)


def lost(rover: FaultyRover) -> Iterator[None]:
    rover.send_good()
    rover.process.send(signal.SIGSTOP)
    # Far more than the node's queue holds.
    for _ in range(60):
        rover.send_good()
    rover.process.send(signal.SIGCONT)
    while True:
        yield
        rover.send_good()


def slow(rover: FaultyRover) -> Iterator[None]:
    rover.set(max_image_age=0.01)
    try:
        while True:
            rover.send_good()
            yield
    finally:
        rover.set(max_image_age=2.0)


def flood(rover: FaultyRover) -> Iterator[None]:
    while True:
        for _ in range(5):
            rover.send_good()
        yield


def no_imu(rover: FaultyRover) -> Iterator[None]:
    rover.set(gravity_source='imu')
    try:
        while True:
            rover.send_good()
            yield
    finally:
        rover.set(gravity_source='estimate')


def second_node(rover: FaultyRover) -> Iterator[None]:
    second = rover.graph.create_node('obstacle_detector', namespace='/stereo')
    try:
        while True:
            yield
    finally:
        second.destroy_node()


def second_publisher(rover: FaultyRover) -> Iterator[None]:
    second = rover.camera.create('left', 'camera_info')
    try:
        while True:
            yield
    finally:
        rover.graph.node.destroy_publisher(second)


def latched_subscriber(rover: FaultyRover) -> Iterator[None]:
    from rclpy.qos import DurabilityPolicy, QoSProfile

    second = rover.graph.node.create_subscription(
        message_type('sensor_msgs/msg/Image'),
        '/stereo/obstacle_mask',
        lambda message: None,
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    )
    try:
        while True:
            yield
    finally:
        rover.graph.node.destroy_subscription(second)
