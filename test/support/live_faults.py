"""Faults of a camera and of its users, injected into a stream of good pairs.

Each fault is a generator: one step in place of each good pair, until it ends.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import cv2
import numpy as np
from live_load import NODE_MASK, OUTPUTS
from live_rover import SECOND, Rover
from spoilt_images import no_stamp, set_field, shrink, truncate

# More than the watchdog's `frozen_after`.
FROZEN_PAIRS = 13
BURST_PAIRS = 20

Fault = Callable[['Stage'], Iterator[None]]


class Stage:
    """The node with subscribers to mask and clouds, and the camera that feeds it.

    ``views`` are several exposures of one camera, because one that repeats its image is frozen;
    ``other`` is a pair of another camera.
    """

    def __init__(self, rover: Rover, views: Sequence[Any], other: Any) -> None:
        self.rover = rover
        self.other = other
        self.sent_ns: set[int] = set()
        """Stamps of the good pairs."""
        self.latest_mask_ns = 0
        self._views = itertools.cycle(views)
        self._subscribe()

    def send_good(self) -> None:
        """Send a pair that the node must judge."""
        self.sent_ns.add(self.send())

    def send(self, view: Any = None, *, late_ns: int = 0, infos: bool = True) -> int:
        """Send a pair that is not counted; return its stamp."""
        view = self.next_view() if view is None else view
        stamp = time.time_ns() - late_ns
        if infos:
            self.rover.camera.send_infos(view.scene.camera, stamp)
        self.send_images(*self.images(view, stamp))
        return stamp

    def next_view(self) -> Any:
        return next(self._views)

    def images(self, view: Any = None, stamp: int | None = None) -> tuple[Any, Any]:
        view = self.next_view() if view is None else view
        stamp = time.time_ns() if stamp is None else stamp
        camera = self.rover.camera
        return camera.image(view.left, stamp), camera.image(view.right, stamp)

    def send_images(self, left: Any, right: Any) -> None:
        self.rover.camera.send_images(left, right)

    def take_latencies(self) -> list[float]:
        """Take the masks of good pairs that came: seconds since they were sent."""
        mask = self.rover.mask
        arrivals = list(zip(mask.stamps_ns, mask.arrivals_s, strict=True))
        for topic in (mask, *self._clouds):
            topic.messages.clear()
            topic.arrivals_s.clear()
        if arrivals:
            self.latest_mask_ns = arrivals[-1][0]
        return [
            arrival_s - stamp / SECOND for stamp, arrival_s in arrivals if stamp in self.sent_ns
        ]

    def all_unsubscribe(self) -> None:
        for topic in (self.rover.mask, *self._clouds):
            self.rover.graph.unsubscribe(topic)

    def all_subscribe(self) -> None:
        self.rover.mask = self.rover.graph.subscribe(OUTPUTS[NODE_MASK], NODE_MASK)
        self._subscribe()

    def until_connected(self) -> Iterator[None]:
        """Send uncounted pairs until the node judges one."""
        first = self.send()
        yield
        while self.latest_mask_ns < first:
            self.send()
            yield

    def _subscribe(self) -> None:
        self._clouds = [
            self.rover.graph.subscribe(type_, topic)
            for topic, type_ in OUTPUTS.items()
            if topic != NODE_MASK
        ]


def spoilt(side: str, spoil: Callable[[Any], None]) -> Fault:
    """Make a fault of two pairs, one image of each spoilt."""

    def fault(stage: Stage) -> Iterator[None]:
        for _ in range(2):
            left, right = stage.images()
            spoil(left if side == 'left' else right)
            stage.send_images(left, right)
            yield

    return fault


def bad_info(**changes: Any) -> Fault:
    """Make a fault of one camera_info, with two pairs that have no other."""

    def fault(stage: Stage) -> Iterator[None]:
        camera = stage.rover.camera
        info = camera.info(stage.next_view().scene.camera, 'left', time.time_ns())
        for name, value in changes.items():
            setattr(info, name, value)
        camera.publishers['left', 'camera_info'].publish(info)
        for _ in range(2):
            stage.send(infos=False)
            yield

    return fault


def uniform(grey: int) -> Fault:
    """Make a fault of three pairs of a single grey level."""

    def fault(stage: Stage) -> Iterator[None]:
        for _ in range(3):
            images = stage.images()
            for image in images:
                image.data = bytes([grey]) * len(image.data)
            stage.send_images(*images)
            yield

    return fault


def lost_infos(stage: Stage) -> Iterator[None]:
    for _ in range(4):
        stage.send(infos=False)
        yield


def other_camera(stage: Stage) -> Iterator[None]:
    for _ in range(3):
        stage.send(stage.other)
        yield
    # The images may overtake the camera_info.
    stage.send()
    yield


def swapped(stage: Stage) -> Iterator[None]:
    for _ in range(2):
        stage.send_images(*reversed(stage.images()))
        yield


def frozen(stage: Stage) -> Iterator[None]:
    view = stage.next_view()
    for _ in range(FROZEN_PAIRS):
        stage.send(view)
        yield


def only_left(stage: Stage) -> Iterator[None]:
    for _ in range(6):
        left, _ = stage.images()
        stage.rover.camera.publishers['left', 'image_rect'].publish(left)
        yield


def silence(stage: Stage) -> Iterator[None]:
    for _ in range(6):
        yield


def stamps_go_back(stage: Stage) -> Iterator[None]:
    for _ in range(3):
        stage.send(late_ns=3600 * SECOND)
        yield


def burst(stage: Stage) -> Iterator[None]:
    for _ in range(BURST_PAIRS):
        stage.send()
    # The node works off what waited.
    yield
    yield


def colour_and_16_bit(stage: Stage) -> Iterator[None]:
    for change in (
        lambda array: cv2.cvtColor(array, cv2.COLOR_GRAY2BGR),
        lambda array: array.astype(np.uint16) << 4,
    ):
        view, stamp = stage.next_view(), time.time_ns()
        camera = stage.rover.camera
        images = [camera.image(change(array), stamp) for array in (view.left, view.right)]
        stage.send_images(*images)
        yield


def subscriber_comes_and_goes(stage: Stage) -> Iterator[None]:
    graph = stage.rover.graph
    topics = [
        graph.subscribe('sensor_msgs/msg/Image', '/stereo/detection_image'),
        graph.subscribe('visualization_msgs/msg/MarkerArray', '/stereo/obstacle_markers'),
    ]
    for _ in range(6):
        stage.send_good()
        yield
    for topic in topics:
        graph.unsubscribe(topic)


def all_subscribers_go_and_come(stage: Stage) -> Iterator[None]:
    stage.all_unsubscribe()
    for _ in range(4):
        stage.send()
        yield
    stage.all_subscribe()
    yield from stage.until_connected()


def parameter_change(stage: Stage) -> Iterator[None]:
    for value in (0.12, 0.10):
        stage.rover.set(max_step=value)
        for _ in range(2):
            stage.send_good()
            yield


def refused_parameter(stage: Stage) -> Iterator[None]:
    assert not stage.rover.request_parameters(max_step=-1.0).successful
    stage.send_good()
    yield


def lifecycle(stage: Stage) -> Iterator[None]:
    for name in ('deactivate', 'activate'):
        stage.rover.transition(name)
        stage.send()
        yield
    yield from stage.until_connected()


FAULTS: dict[str, Fault] = {
    'wrong encoding': spoilt('right', set_field('encoding', 'yuv9')),
    'truncated data': spoilt('left', truncate),
    'wrong step': spoilt('left', set_field('step', 7)),
    'one image smaller': spoilt('left', shrink),
    'another camera': other_camera,
    'camera_info not finite': bad_info(p=np.full(12, math.nan)),
    'camera_info without size': bad_info(width=0),
    'no camera_info': lost_infos,
    'images swapped': swapped,
    'image frozen': frozen,
    'blackout': uniform(0),
    'over-exposed': uniform(255),
    'stamp is zero': spoilt('left', no_stamp),
    'stamps go back': stamps_go_back,
    'only left images': only_left,
    'silence': silence,
    'burst': burst,
    'colour and 16 bit': colour_and_16_bit,
    'subscriber comes and goes': subscriber_comes_and_goes,
    'all subscribers go and come': all_subscribers_go_and_come,
    'parameter change': parameter_change,
    'parameter refused': refused_parameter,
    'deactivate and activate': lifecycle,
}
