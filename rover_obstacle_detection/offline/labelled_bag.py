"""Read labelled frames from a recording: stereo pairs and their ground truth."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.reader import BadMessage, BagReader
from rover_obstacle_detection.bags.stereo import BadFrame, StereoPair, StereoPairs
from rover_obstacle_detection.bags.topics import IMAGE_TYPES
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
TEXT_TYPE = 'std_msgs/msg/String'
POSE_TYPE = 'geometry_msgs/msg/PoseStamped'
LABEL_VALUES = (FREE, ROCK, SLOPE, DROP, NOT_COUNTED)
# A rotation's quaternion has norm 1; anything else, such as all zeros, is not an orientation.
SQUARED_NORM_LIMITS = (0.9, 1.1)


@dataclass(frozen=True)
class TruthTopics:
    """The ground truth topics of a recording; all but the labels are optional."""

    labels: str
    instances: str | None
    depth: str | None
    scene: str | None
    pose: str | None = None

    @property
    def stamped(self) -> tuple[str, ...]:
        """The topics with one message per pair."""
        stamped = (self.labels, self.instances, self.depth, self.pose)
        return tuple(name for name in stamped if name)


def find_truth_topics(bag: BagReader, labels: str | None = None) -> TruthTopics:
    """Find ``truth/labels``, and ``instances``, ``depth``, ``scene`` and ``pose`` next to it.

    Parameters
    ----------
    bag : BagReader
    labels : str, optional
        Labels topic; found by name if omitted.

    Raises
    ------
    BagError
        If there is no labels topic or more than one.
    """
    if labels is None:
        found = [name for name in sorted(bag.topics) if _ends_in(name, LABELS)]
        if len(found) != 1:
            topics = ', '.join(found or sorted(bag.topics)) or 'no topics'
            problem = f'{len(found)} labels topics' if found else f'no topic {LABELS}'
            raise BagError(
                f'{bag.path}: {problem}: the recording has {topics}; '
                'choose one with --labels-topic'
            )
        labels = found[0]
    if bag.topics.get(labels) not in IMAGE_TYPES:
        found_type = bag.topics.get(labels, 'missing')
        raise BagError(f'{bag.path}: topic {labels} is {found_type}: expected {IMAGE_TYPES[0]}')
    namespace = labels.rpartition('/')[0]
    instances, depth, scene, pose = (
        name if (name := f'{namespace}/{base}') in bag.topics else None
        for base in ('instances', 'depth', 'scene', 'pose')
    )
    if pose is not None and bag.topics[pose] != POSE_TYPE:
        pose = None
    return TruthTopics(labels, instances, depth, scene, pose)


def recorded_scene(bag: BagReader, truth: TruthTopics) -> Mapping[str, Any]:
    """Read the scene description written by ``simulate``; empty if there is none."""
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
    """Read the scene's conditions and rig from the description written by ``simulate``.

    Returns
    -------
    tuple of str
        For example ``low_texture``, ``rig navcam``; empty if there is no description.
    """
    scene = recorded_scene(bag, truth)
    conditions = scene.get('conditions', ())
    named = conditions if isinstance(conditions, list) else ()
    rig = (f'rig {scene["rig"]}',) if 'rig' in scene else ()
    return (*map(str, named), *rig)


def read_labelled(pairs: StereoPairs, truth: TruthTopics) -> Iterator[LabelledFrame | BadFrame]:
    """Yield pairs with their labels; pairs without valid labels become bad frames.

    Parameters
    ----------
    pairs : StereoPairs
        Pairs read with ``truth.stamped`` as extra topics.
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
    labels = _extra_image(pair, truth.labels, decode_any_image)
    if labels is None:
        raise ImageError(f'{truth.labels}: no labels with the stamp of the pair')
    _check_labels(labels, truth.labels)
    instances = _extra_image(pair, truth.instances, decode_any_image)
    if instances is None:
        # Without instances, connected rock pixels are one rock.
        instances = connected(labels == ROCK)
    return LabelledFrame(
        stamp_ns=pair.stamp_ns,
        camera=pair.camera,
        left=pair.left,
        right=pair.right,
        labels=labels,
        instances=instances.astype(np.uint16),
        depth_m=_extra_image(pair, truth.depth, decode_float_image),
        gravity=_gravity(pair, truth.pose),
    )


def _extra_image(
    pair: StereoPair, topic: str | None, decode: Callable[[Any, str], NDArray[Any]]
) -> NDArray[Any] | None:
    """Decode an extra image of the left image's size; None if the pair has none."""
    if topic is None or topic not in pair.extras:
        return None
    image = decode(pair.extras[topic], topic)
    if image.shape != pair.left.shape[:2]:
        height, width = pair.left.shape[:2]
        shape = ' x '.join(str(size) for size in image.shape[1::-1] + image.shape[2:])
        raise ImageError(
            f'{topic} is {shape}, the left image {width} x {height}: expected the same size'
        )
    return image


def _gravity(pair: StereoPair, topic: str | None) -> Gravity | None:
    if topic is None or topic not in pair.extras:
        return None
    orientation = pair.extras[topic].pose.orientation
    x, y, z, w = (float(getattr(orientation, name)) for name in 'xyzw')
    square = x * x + y * y + z * z + w * w
    lowest, highest = SQUARED_NORM_LIMITS
    if not lowest < square < highest:
        return None
    # The world's z axis in the optical frame: the last row of the rotation matrix.
    up = (2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z)
    return Gravity((up[0] / square, up[1] / square, up[2] / square))


def _check_labels(labels: NDArray[Any], topic: str) -> None:
    expected = f'expected mono8 with {", ".join(map(str, LABEL_VALUES))}'
    if labels.dtype != np.uint8:
        raise ImageError(f'{topic} has type {labels.dtype}: {expected}')
    values = np.flatnonzero(np.bincount(labels.ravel()))
    unknown = np.setdiff1d(values, LABEL_VALUES)
    if unknown.size:
        raise ImageError(f'{topic} has the value {unknown[0]}: {expected}')


def _ends_in(topic: str, name: str) -> bool:
    return f'/{topic}'.endswith(f'/{name}')
