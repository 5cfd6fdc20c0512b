"""Labelled frames out of a recording: stereo pairs with the truth of the same stamp."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.reader import BadMessage, BagReader
from rover_obstacle_detection.bags.stereo import BadFrame, StereoPair, StereoPairs
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.errors import BagError, ImageError
from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.evaluation.labels import (
    DROP,
    FREE,
    NOT_COUNTED,
    ROCK,
    SLOPE,
    connected,
)
from rover_obstacle_detection.messages.image import decode_any_image, decode_float_image

LABELS = 'truth/labels'
INSTANCES = 'truth/instances'
DEPTH = 'truth/depth'
POSE = 'truth/pose'
SCENE = 'truth/scene'
TEXT_TYPE = 'std_msgs/msg/String'
POSE_TYPE = 'geometry_msgs/msg/PoseStamped'
IMAGE_TYPES = ('sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage')
LABEL_VALUES = (FREE, ROCK, SLOPE, DROP, NOT_COUNTED)


@dataclass(frozen=True)
class TruthTopics:
    """Where a recording holds its truth; without instances, connected rock pixels are one rock."""

    labels: str
    instances: str | None
    depth: str | None
    scene: str | None
    pose: str | None = None

    @property
    def stamped(self) -> tuple[str, ...]:
        """Those that come with every pair."""
        stamped = (self.labels, self.instances, self.depth, self.pose)
        return tuple(name for name in stamped if name)


def find_truth_topics(bag: BagReader, labels: str | None = None) -> TruthTopics:
    """Find ``truth/labels``, and ``instances``, ``depth``, ``scene`` and ``pose`` beside it.

    Parameters
    ----------
    bag : BagReader
    labels : str, optional
        The labels' topic where it is called something else.

    Raises
    ------
    BagError
        If there are no labels, or more than one topic that may be them.
    """
    if labels is None:
        found = [name for name in sorted(bag.topics) if _ends_in(name, LABELS)]
        if len(found) != 1:
            held = ', '.join(found or sorted(bag.topics)) or 'nothing'
            what = f'{len(found)} topics of labels' if found else f'no topic {LABELS}'
            msg = f'{bag.path}: {what}: it holds {held}; choose one with --labels-topic'
            raise BagError(msg)
        labels = found[0]
    if bag.topics.get(labels) not in IMAGE_TYPES:
        there = bag.topics.get(labels, 'not there')
        msg = f'{bag.path}: topic {labels} is {there}: expected {IMAGE_TYPES[0]}'
        raise BagError(msg)
    beside = labels.rpartition('/')[0]
    instances, depth, scene, pose = (
        name if (name := f'{beside}/{own.rpartition("/")[2]}') in bag.topics else None
        for own in (INSTANCES, DEPTH, SCENE, POSE)
    )
    if pose is not None and bag.topics[pose] != POSE_TYPE:
        pose = None
    return TruthTopics(labels, instances, depth, scene, pose)


def recorded_scene(bag: BagReader, truth: TruthTopics) -> Mapping[str, Any]:
    """Read what ``truth/scene`` says of the scene, as `simulate` writes it; empty without one."""
    if truth.scene is None or bag.topics[truth.scene] != TEXT_TYPE:
        return {}
    for _, _, message in bag.messages([truth.scene]):
        if isinstance(message, BadMessage):
            return {}
        try:
            scene = json.loads(message.data)
        except ValueError:
            return {}
        return scene if isinstance(scene, dict) else {}
    return {}


def recorded_conditions(bag: BagReader, truth: TruthTopics) -> tuple[str, ...]:
    """Read the scene's conditions and its rig from ``truth/scene``, as `simulate` writes it.

    Returns
    -------
    tuple of str
        Such as ``low_texture``, ``rig navcam``; empty where the recording does not say.
    """
    scene = recorded_scene(bag, truth)
    conditions = scene.get('conditions', ())
    named = conditions if isinstance(conditions, list) else ()
    rig = (f'rig {scene["rig"]}',) if 'rig' in scene else ()
    return (*map(str, named), *rig)


def read_labelled(pairs: StereoPairs, truth: TruthTopics) -> Iterator[LabelledFrame | BadFrame]:
    """Read the pairs that have labels; one without, or with labels that do not fit, is bad.

    Parameters
    ----------
    pairs : StereoPairs
        Made with the truth's topics as its extra ones.
    truth : TruthTopics
    """
    for pair in pairs:
        if isinstance(pair, BadFrame):
            yield pair
            continue
        try:
            yield _labelled(pair, truth)
        except ImageError as error:
            yield BadFrame(pair.stamp_ns, truth.labels, str(error))


def _labelled(pair: StereoPair, truth: TruthTopics) -> LabelledFrame:
    labels = _decoded(pair, truth.labels)
    if labels is None:
        msg = f'{truth.labels}: no labels with the stamp of the pair'
        raise ImageError(msg)
    _check_labels(labels, truth.labels)
    instances = _decoded(pair, truth.instances)
    depth_m = _depth(pair, truth.depth)
    return LabelledFrame(
        stamp_ns=pair.stamp_ns,
        camera=pair.camera,
        left=pair.left,
        right=pair.right,
        labels=labels,
        instances=_rock_numbers(labels) if instances is None else instances.astype(np.uint16),
        depth_m=depth_m,
        gravity=_gravity(pair, truth.pose),
    )


def _decoded(pair: StereoPair, topic: str | None) -> NDArray[Any] | None:
    if topic is None or topic not in pair.extras:
        return None
    image = decode_any_image(pair.extras[topic], topic)
    _check_shape(image, pair, topic)
    return image


def _depth(pair: StereoPair, topic: str | None) -> NDArray[np.float32] | None:
    if topic is None or topic not in pair.extras:
        return None
    depth_m = decode_float_image(pair.extras[topic], topic)
    _check_shape(depth_m, pair, topic)
    return depth_m


def _gravity(pair: StereoPair, topic: str | None) -> Gravity | None:
    if topic is None or topic not in pair.extras:
        return None
    turn = pair.extras[topic].pose.orientation
    x, y, z, w = (float(value) for value in (turn.x, turn.y, turn.z, turn.w))
    square = x * x + y * y + z * z + w * w
    if not 0.9 < square < 1.1:
        return None
    # The world's z as the optical frame sees it: the last row of the rotation.
    up = (2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z)
    return Gravity((up[0] / square, up[1] / square, up[2] / square))


def _check_shape(image: NDArray[Any], pair: StereoPair, topic: str) -> None:
    if image.shape != pair.left.shape[:2]:
        height, width = pair.left.shape[:2]
        shape = ' x '.join(str(size) for size in image.shape[1::-1] + image.shape[2:])
        msg = f'{topic} is {shape}, the left image {width} x {height}: expected the same size'
        raise ImageError(msg)


def _check_labels(labels: NDArray[Any], topic: str) -> None:
    expected = f'expected mono8 with {", ".join(map(str, LABEL_VALUES))}'
    if labels.dtype != np.uint8:
        msg = f'{topic} has type {labels.dtype}: {expected}'
        raise ImageError(msg)
    values = np.flatnonzero(np.bincount(labels.ravel()))
    unknown = np.setdiff1d(values, LABEL_VALUES)
    if unknown.size:
        msg = f'{topic} has the value {unknown[0]}: {expected}'
        raise ImageError(msg)


def _rock_numbers(labels: NDArray[np.uint8]) -> NDArray[np.uint16]:
    return connected(labels == ROCK).astype(np.uint16)


def _ends_in(topic: str, name: str) -> bool:
    return f'/{topic}'.endswith(f'/{name}')
