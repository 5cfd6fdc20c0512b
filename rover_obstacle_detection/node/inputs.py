"""The node's input topics: images are paired as they arrive, calibrations kept."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import deserialize_message

from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.node.calibration import LiveCalibration
from rover_obstacle_detection.node.image_pair import ImagePair
from rover_obstacle_detection.node.loss_counter import LossCounter
from rover_obstacle_detection.node.rclpy_factory import message_type
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.statistics import NodeStatistics
from rover_obstacle_detection.pairing import PairingStatistics, StereoPairing

SIDES = ('left', 'right')
INFO_TYPE = 'sensor_msgs/msg/CameraInfo'
IMAGE_TYPES = {'raw': 'sensor_msgs/msg/Image', 'compressed': 'sensor_msgs/msg/CompressedImage'}

# A serialised message with a header begins with 4 bytes of encoding and 8 of stamp.
STAMP_END = 12


class StereoInputs:
    """Subscriptions to two eyes; used from the executor's thread only.

    Images are listened to between `listen` and `rest` only: taking 10 pairs a second that nobody
    wants costs 5 % of a core, and the calibrations sent with them another 2 %. At rest, those are
    listened to until there is a camera.

    Parameters
    ----------
    node : rclpy node
    settings : Settings
    calibration : LiveCalibration
    statistics : NodeStatistics
    on_pair : callable
        Takes each `ImagePair`; must return at once.
    warn : callable
        Takes a line that says what is wrong with an input.

    Attributes
    ----------
    topics : tuple of str
        Full names, remapped, of the two image topics.
    """

    def __init__(
        self,
        node: Any,
        settings: Settings,
        *,
        calibration: LiveCalibration,
        statistics: NodeStatistics,
        on_pair: Callable[[ImagePair], None],
        warn: Callable[[str], object],
    ) -> None:
        self._node = node
        self._calibration = calibration
        self._statistics = statistics
        self._on_pair = on_pair
        self._warn = warn
        self._transport = ''
        self._images: list[Any] = []
        self._last_infos = [b'', b'']
        self._losses = (LossCounter(), LossCounter())
        self.configure(settings)
        self._infos: list[Any] = []
        self._listen_to_infos()

    @property
    def pairing(self) -> PairingStatistics:
        """What the pairing counted since the settings last changed."""
        return self._pairing.statistics

    @property
    def listening(self) -> bool:
        """Whether the images are subscribed to."""
        return bool(self._images)

    def configure(self, settings: Settings) -> None:
        """Take up other settings: pairing starts afresh."""
        self._pairing = StereoPairing(settings.tolerance_ns, settings.queue_size)
        if settings.image_transport == self._transport:
            return
        self._transport = settings.image_transport
        left, right = _relative_topics(self._transport)
        self.topics = (
            self._node.resolve_topic_name(left),
            self._node.resolve_topic_name(right),
        )
        if self._images:
            self.rest()
            self.listen()

    def listen(self) -> None:
        """Subscribe to the images."""
        if self._images:
            return
        if not self._infos:
            self._calibration.doubt()
            self._listen_to_infos()
        self._losses = (LossCounter(), LossCounter())
        self._images = [
            self._node.create_subscription(
                message_type(IMAGE_TYPES[self._transport]),
                topic,
                partial(self._take_image, number),
                qos_profile_sensor_data,
                qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            )
            for number, topic in enumerate(_relative_topics(self._transport))
        ]

    def rest(self) -> None:
        """Drop the subscriptions to the images, and what still waits for a partner."""
        for subscription in self._images:
            self._node.destroy_subscription(subscription)
        self._images = []
        self._pairing.flush()
        if self._calibration.state[0] is not None:
            self._drop_infos()

    def destroy(self) -> None:
        """Drop all subscriptions."""
        self.rest()
        self._drop_infos()

    def _listen_to_infos(self) -> None:
        self._infos = [
            self._node.create_subscription(
                message_type(INFO_TYPE),
                f'{side}/camera_info',
                partial(self._take_info, number),
                qos_profile_sensor_data,
                # Nearly all are equal to the one before, and need not become Python objects.
                raw=True,
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
                qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            )
            for number, side in enumerate(SIDES)
        ]

    def _drop_infos(self) -> None:
        for subscription in self._infos:
            self._node.destroy_subscription(subscription)
        self._infos = []

    def _take_info(self, side: int, data: bytes) -> None:
        unstamped = data[STAMP_END:]
        if unstamped == self._last_infos[side]:
            self._calibration.confirm(side)
            return
        self._last_infos[side] = unstamped
        info = deserialize_message(data, message_type(INFO_TYPE))
        if not self._calibration.take(side, info):
            return
        camera, _ = self._calibration.state
        if camera is not None:
            self._node.get_logger().info(
                f'camera: {camera.width} x {camera.height}, fx {camera.fx:.2f} px, '
                f'baseline {camera.baseline_m * 1000:.1f} mm'
            )
            if not self._images:
                self._drop_infos()

    def _take_image(self, side: int, message: Any, info: Mapping[str, Any]) -> None:
        arrival_s = time.monotonic()
        number = info.get('publication_sequence_number')
        self._statistics.lost(self._losses[side].lost_before(number))
        stamp = stamp_ns(message.header)
        if stamp <= 0:
            self._statistics.bad_frame('stamp is zero')
            self._warn(f'{self.topics[side]}: header.stamp is zero: expected the time of exposure')
            return
        add = self._pairing.add_right if side else self._pairing.add_left
        pair = add(stamp, message)
        if pair is not None:
            self._statistics.pair()
            self._on_pair(ImagePair(pair.left, pair.right, arrival_s))


def _relative_topics(transport: str) -> list[str]:
    suffix = '' if transport == 'raw' else f'/{transport}'
    return [f'{side}/image_rect{suffix}' for side in SIDES]
