"""The node's stereo input topics: images are paired on arrival, calibrations are kept."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import deserialize_message

from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.raw_images import are_raw
from rover_obstacle_detection.node.calibration import RECTIFIED, Calibrated, LiveCalibration
from rover_obstacle_detection.node.loss_counter import LossCounter
from rover_obstacle_detection.node.rclpy_factory import message_type
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.statistics import NodeStatistics
from rover_obstacle_detection.node.worker import ImagePair
from rover_obstacle_detection.pairing import PairingStatistics, StereoPairing

SIDES = ('left', 'right')
INFO_TOPICS = tuple(f'{side}/camera_info' for side in SIDES)
INFO_TYPE = 'sensor_msgs/msg/CameraInfo'
IMAGE_TYPES = {'raw': 'sensor_msgs/msg/Image', 'compressed': 'sensor_msgs/msg/CompressedImage'}

# A serialised message with a header starts with 4 bytes of encapsulation and 8 of stamp.
STAMP_END = 12

# Reliable, because a best-effort reader does not get what was published before it.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def subscribe(
    node: Any, type_name: str, topic: str, callback: Callable[..., None], **options: Any
) -> Any:
    """Subscribe with sensor-data QoS, which users can override.

    Parameters
    ----------
    node : rclpy node
    type_name : str
        For example ``sensor_msgs/msg/Image``.
    topic : str
    callback : callable
    **options
        Further arguments of ``create_subscription``.
    """
    return node.create_subscription(
        message_type(type_name),
        topic,
        callback,
        # A copy, because rclpy writes what users override into it.
        copy.copy(qos_profile_sensor_data),
        qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        **options,
    )


class StereoInputs:
    """Subscriptions to both cameras; for use in the executor's thread only.

    The node subscribes to images between `start` and `stop` only, because receiving unused
    images costs CPU. Calibrations are received until a camera is known, and with the images.

    Parameters
    ----------
    node : rclpy node
    settings : Settings
    calibration : LiveCalibration
    statistics : NodeStatistics
    on_image : callable
        Receives 0 or 1 for each image of the left or right camera.
    on_pair : callable
        Receives each `ImagePair`; must return at once.
    warn : callable
        Logs a warning.

    Attributes
    ----------
    topics : tuple of str
        Full (remapped) names of the two image topics.
    info_topics : tuple of str
        Full names of the two calibration topics.
    """

    def __init__(
        self,
        node: Any,
        settings: Settings,
        *,
        calibration: LiveCalibration,
        statistics: NodeStatistics,
        on_image: Callable[[int], None],
        on_pair: Callable[[ImagePair], None],
        warn: Callable[[str], object],
    ) -> None:
        self._node = node
        self._calibration = calibration
        self._statistics = statistics
        self._on_image = on_image
        self._on_pair = on_pair
        self._warn = warn
        self._transport = ''
        self._images: list[Any] = []
        self._infos: list[Any] = []
        self._last_infos = [b'', b'']
        self._latched = [False, False]
        self._losses = (LossCounter(), LossCounter())
        self.info_topics = _resolved(node, INFO_TOPICS)
        self.configure(settings)
        self._subscribe_infos()

    @property
    def pairing(self) -> PairingStatistics:
        """Pairing counts since the settings last changed."""
        return self._pairing.statistics

    @property
    def subscribed(self) -> bool:
        """Whether the images are subscribed to."""
        return bool(self._images)

    def configure(self, settings: Settings) -> None:
        """Apply new settings; pairing starts again."""
        self._pairing = StereoPairing(settings.tolerance_ns, settings.queue_size)
        if settings.image_transport != self._transport:
            self._transport = settings.image_transport
            self.topics = _resolved(self._node, _relative_topics(self._transport))
            if self._images:
                self.stop()
                self.start()
        raw = are_raw(*self.topics, settings.rectify)
        changed = self._calibration.set_raw_images(' and '.join(self.topics) if raw else '')
        if changed and (calibrated := self._calibration.calibrated) is not None:
            self._report(calibrated)

    @property
    def subscriptions(self) -> tuple[Any, ...]:
        """The current subscriptions."""
        return (*self._images, *self._infos)

    def set_latched(self, latched: Mapping[str, bool]) -> None:
        """Receive a calibration that was published before this node subscribed.

        Parameters
        ----------
        latched : mapping of str to bool
            Whether the publishers of a topic keep their last message for late subscribers. A
            subscriber that asks for it receives nothing from publishers that do not.
        """
        for side, topic in enumerate(self.info_topics):
            wanted = latched.get(topic, self._latched[side])
            if wanted != self._latched[side]:
                self._latched[side] = wanted
                if self._infos:
                    self._node.destroy_subscription(self._infos[side])
                    self._infos[side] = self._subscribe_info(side)

    def start(self) -> None:
        """Subscribe to the images."""
        if self._images:
            return
        if not self._infos:
            self._calibration.expect_confirmation()
            self._subscribe_infos()
        self._losses = (LossCounter(), LossCounter())
        self._statistics.forget_outcomes()
        self._images = [
            subscribe(
                self._node, IMAGE_TYPES[self._transport], topic, partial(self._take_image, side)
            )
            for side, topic in enumerate(_relative_topics(self._transport))
        ]

    def stop(self) -> None:
        """Unsubscribe from the images and drop those without a partner."""
        self._destroy(self._images)
        self._pairing.flush()
        if self._calibration.state[0] is not None:
            self._destroy(self._infos)

    def destroy(self) -> None:
        """Drop all subscriptions."""
        self.stop()
        self._destroy(self._infos)

    def _subscribe_infos(self) -> None:
        self._infos = [self._subscribe_info(side) for side in range(len(SIDES))]

    def _subscribe_info(self, side: int) -> Any:
        options: dict[str, Any] = {
            # Most repeat the previous one and need no deserialisation.
            'raw': True,
            'event_callbacks': SubscriptionEventCallbacks(use_default_callbacks=False),
        }
        topic, callback = INFO_TOPICS[side], partial(self._take_info, side)
        if not self._latched[side]:
            return subscribe(self._node, INFO_TYPE, topic, callback, **options)
        # Without overrides: those of the other subscription would make it best effort.
        return self._node.create_subscription(
            message_type(INFO_TYPE), topic, callback, LATCHED, **options
        )

    def _destroy(self, subscriptions: list[Any]) -> None:
        for subscription in subscriptions:
            self._node.destroy_subscription(subscription)
        subscriptions.clear()

    def _take_info(self, side: int, data: bytes) -> None:
        unstamped = data[STAMP_END:]
        if unstamped == self._last_infos[side]:
            self._calibration.confirm(side)
            return
        self._last_infos[side] = unstamped
        info = deserialize_message(data, message_type(INFO_TYPE))
        if not self._calibration.update(side, info):
            return
        if (calibrated := self._calibration.calibrated) is not None:
            self._report(calibrated)
            if not self._images:
                self._destroy(self._infos)

    def _report(self, calibrated: Calibrated) -> None:
        camera, rectify, images = calibrated
        logger = self._node.get_logger()
        logger.info(
            f'camera: {camera.width} x {camera.height}, fx {camera.fx:.2f} px, '
            f'baseline {camera.baseline_m * 1000:.1f} mm'
        )
        if rectify is not None:
            logger.info(images)
        elif images == RECTIFIED:
            logger.info(f'{" and ".join(self.topics)} are taken as rectified')
        else:
            self._warn(images)

    def _take_image(self, side: int, message: Any, info: Mapping[str, Any]) -> None:
        arrival_s = time.monotonic()
        number = info.get('publication_sequence_number')
        self._statistics.image(self._losses[side].lost_before(number))
        self._on_image(side)
        stamp = stamp_ns(message.header)
        if stamp <= 0:
            problem = f'{self.topics[side]}: header.stamp is zero: expected the time of exposure'
            self._statistics.bad_frame('stamp is zero', problem)
            self._warn(problem)
            return
        add = self._pairing.add_right if side else self._pairing.add_left
        pair = add(stamp, message)
        if pair is not None:
            self._statistics.pair()
            self._on_pair(ImagePair(pair.left, pair.right, arrival_s))


def _resolved(node: Any, topics: Sequence[str]) -> tuple[str, str]:
    left, right = topics
    return node.resolve_topic_name(left), node.resolve_topic_name(right)


def _relative_topics(transport: str) -> list[str]:
    suffix = '' if transport == 'raw' else f'/{transport}'
    return [f'{side}/image_rect{suffix}' for side in SIDES]
