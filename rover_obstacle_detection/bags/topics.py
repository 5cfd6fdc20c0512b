"""The stereo camera's topics in a recording, given or found by name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile
from typing import Literal, NamedTuple

from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.messages.raw_images import (
    BY_NAME,
    are_raw,
    base_name,
    is_named_rectified,
)

IMAGE_TYPE = 'sensor_msgs/msg/Image'
COMPRESSED_TYPE = 'sensor_msgs/msg/CompressedImage'
INFO_TYPE = 'sensor_msgs/msg/CameraInfo'
IMAGE_TYPES = (IMAGE_TYPE, COMPRESSED_TYPE)

# Words that name the left camera, with their right counterparts; infra1/infra2 is RealSense, and
# cam0/cam1 EuRoC.
_COUNTERPARTS = {'left': 'right', 'infra1': 'infra2', '0': '1'}


class _Naming(NamedTuple):
    """What names the cameras of a pair in their topics."""

    left: re.Pattern[str]
    right: re.Pattern[str]


_WORD = r'((?<![a-z])|(?<=front)|(?<=rear)|(?<=back))({})(?![a-z0-9])'
_NUMBER = r'((?<=cam)|(?<=camera)|(?<=cam_)|(?<=camera_)){}(?![a-z0-9])'
_NAMED = _Naming(
    *(re.compile(_WORD.format(words), re.I) for words in ('left|infra1', 'right|infra2'))
)
# Numbers say less than words: they count only in a recording without a pair that words name.
_NUMBERED = _Naming(*(re.compile(_NUMBER.format(number), re.I) for number in '01'))
# These words describe the image, not the camera: left_raw and left are one camera.
_IMAGE_WORDS = re.compile(
    r'(?<![a-z])(camera_info|info|image|raw|rect|colou?r|gr[ae]y|mono)(?![a-z])', re.I
)
_NOT_CAMERA_IMAGES = re.compile(
    r'depth|disparity|mask|label|instance|segment|semantic|confidence|normal|debug|detection', re.I
)
_TRANSPORT = '/compressed'
_LISTED_TOPICS = 12  # in an error message


@dataclass(frozen=True)
class StereoTopics:
    """The four topics of a stereo camera; an info topic is None if the recording has none.

    ``rectify`` says which images are raw, one of `messages.raw_images.RECTIFY`.
    """

    left_image: str
    right_image: str
    left_info: str | None = None
    right_info: str | None = None
    rectify: str = BY_NAME

    @property
    def namespace(self) -> str:
        """Common prefix of the image topics, such as ``/stereo``; may be empty."""
        parts = zip(self.left_image.split('/'), self.right_image.split('/'), strict=False)
        if self.is_side_by_side:
            return self.left_image.rpartition('/')[0]
        return '/'.join(left for left, _ in takewhile(lambda pair: pair[0] == pair[1], parts))

    @property
    def is_side_by_side(self) -> bool:
        """Whether each image of one topic shows both views, the left one in its left half."""
        return self.left_image == self.right_image

    @property
    def is_rectified(self) -> bool:
        """Whether the images are rectified, by the names of their topics or as the user says."""
        return not are_raw(self.left_image, self.right_image, self.rectify)


def find_stereo_topics(
    topics: Mapping[str, str], *, left_image: str | None = None, right_image: str | None = None
) -> StereoTopics:
    """Find the topics of the stereo camera.

    Rectified images are preferred over raw ones, grey over colour, uncompressed over compressed.

    Parameters
    ----------
    topics : mapping of str to str
        Message type of each topic in the recording.
    left_image, right_image : str, optional
        Image topics to use; found by name if omitted.

    Raises
    ------
    BagError
        If there is no stereo camera or more than one, or if a given topic does not exist or is
        not an image. The message lists the topics of the recording.
    """
    for given in (left_image, right_image):
        _check_given(topics, given)
    if left_image is None or right_image is None:
        left_image, right_image = _find_images(topics, left_image, right_image)
    if left_image == right_image:
        raise BagError(f'left and right image topic are both {left_image}: expected two topics')
    return _with_infos(topics, left_image, right_image)


def stereo_cameras(topics: Mapping[str, str]) -> list[StereoTopics]:
    """Find the topics of every stereo camera; see `find_stereo_topics`.

    Parameters
    ----------
    topics : mapping of str to str
        Message type of each topic in the recording.

    Returns
    -------
    list of StereoTopics
        The preferred images of each camera, sorted; empty if there is none.
    """
    return [_with_infos(topics, *images) for images in _preferred_pairs(topics)]


def _with_infos(topics: Mapping[str, str], left_image: str, right_image: str) -> StereoTopics:
    left_info = _find_info(topics, left_image, 'left')
    right_info = _find_info(topics, right_image, 'right')
    if left_info == right_info:
        # A camera_info that both images share describes neither camera reliably.
        left_info = right_info = None
    return StereoTopics(left_image, right_image, left_info, right_info)


def side_by_side_topics(topics: Mapping[str, str], image: str) -> StereoTopics:
    """Return the one topic whose images show both views side by side, without a calibration.

    Raises
    ------
    BagError
        If it does not exist or is not an image.
    """
    _check_given(topics, image)
    return StereoTopics(image, image)


def _check_given(topics: Mapping[str, str], name: str | None) -> None:
    if name is None:
        return
    if name not in topics:
        raise BagError(f'no topic {name}: {_contents(topics, IMAGE_TYPES)}')
    if topics[name] not in IMAGE_TYPES:
        raise BagError(f'topic {name} is {topics[name]}: expected {" or ".join(IMAGE_TYPES)}')


def _find_images(
    topics: Mapping[str, str], left: str | None, right: str | None
) -> tuple[str, str]:
    if left is not None or right is not None:
        for naming in (_NAMED, _NUMBERED):
            for pair in _image_pairs(topics, naming):
                if left == pair[0] or right == pair[1]:
                    return pair
        given, other = (left, 'right') if left is not None else (right, 'left')
        raise BagError(
            f'no {other} image topic matches {given}: give --{other}-topic; {_contents(topics)}'
        )
    best = _preferred_pairs(topics)
    if not best:
        raise BagError(_no_pair(topics))
    if len(best) > 1:
        listed = '; '.join(f'{one} and {other}' for one, other in best)
        raise BagError(
            f'{len(best)} stereo cameras: {listed}: choose one with --left-topic and --right-topic'
        )
    return best[0]


def _preferred_pairs(topics: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return the preferred image topics of each stereo camera, sorted."""
    for naming in (_NAMED, _NUMBERED):
        cameras: dict[str, list[tuple[str, str]]] = {}
        for pair in _image_pairs(topics, naming):
            cameras.setdefault(_camera_key(pair[0], naming.left), []).append(pair)
        if cameras:
            return sorted(
                min(each, key=lambda pair: _rank(pair[0], topics)) for each in cameras.values()
            )
    return []


def _image_pairs(topics: Mapping[str, str], naming: _Naming) -> list[tuple[str, str]]:
    pairs = []
    for name in sorted(topics):
        if not _is_camera_image(name, topics, naming):
            continue
        for partner in _right_names(name, naming.left):
            if topics.get(partner) == topics[name]:
                pairs.append((name, partner))
                break
    return pairs


def _right_names(left: str, side: re.Pattern[str]) -> list[str]:
    """Names that the right topic may have: one left word replaced, or all of them."""
    words = list(side.finditer(left))
    one = [
        left[: word.start()] + _counterpart(word.group()) + left[word.end() :]
        for word in reversed(words)
    ]
    return [*one, side.sub(lambda word: _counterpart(word.group()), left)] if words else []


def _counterpart(word: str) -> str:
    """Return the right word for a left one, in the same case."""
    counterpart = _COUNTERPARTS[word.lower()]
    if word.isupper():
        return counterpart.upper()
    return counterpart.capitalize() if word[0].isupper() else counterpart


def _is_camera_image(name: str, topics: Mapping[str, str], naming: _Naming = _NAMED) -> bool:
    if topics[name] not in IMAGE_TYPES:
        return False
    side = _NAMED.left.search(name) or _NAMED.right.search(name)
    if naming is _NUMBERED:
        return not side and not _NOT_CAMERA_IMAGES.search(name)
    # The part before the left or right word is a namespace and does not describe the image.
    start = name.rfind('/', 0, side.start()) + 1 if side else 0
    return not _NOT_CAMERA_IMAGES.search(name, start)


def _rank(topic: str, topics: Mapping[str, str]) -> tuple[int, bool, str]:
    """Sort key of image topics, the preferred one first."""
    base = base_name(topic)
    if base == 'image_rect':
        kind = 0
    elif is_named_rectified(topic):
        kind = 2 if 'col' in base else 1
    else:
        kind = 3 if 'raw' in base else 4
    return kind, topics[topic] == COMPRESSED_TYPE, topic


def _camera_key(topic: str, side: re.Pattern[str]) -> str:
    """Identify a topic's camera: its path without the left or right word and what follows."""
    words = list(side.finditer(topic))
    if not words:
        return topic
    word = words[-1]
    start = topic.rfind('/', 0, word.start()) + 1
    end = topic.find('/', word.end())
    component = topic[start:] if end < 0 else topic[start:end]
    rest = _IMAGE_WORDS.sub('', side.sub('', component)).strip('_')
    return topic[:start] + rest


def _find_info(
    topics: Mapping[str, str], image: str, side_name: Literal['left', 'right']
) -> str | None:
    sibling = image.removesuffix(_TRANSPORT).rpartition('/')[0] + '/camera_info'
    if topics.get(sibling) == INFO_TYPE:
        return sibling
    named = getattr(_NAMED, side_name)
    side = named if named.search(image) else getattr(_NUMBERED, side_name)
    key = _camera_key(image, side)
    same_camera = (
        name
        for name, type_name in sorted(topics.items())
        if type_name == INFO_TYPE and side.search(name) and _camera_key(name, side) == key
    )
    return next(same_camera, None)


def _no_pair(topics: Mapping[str, str]) -> str:
    images = [name for name in sorted(topics) if _is_camera_image(name, topics)]
    for side, other, words in (
        ('left', 'right', _NAMED.left),
        ('right', 'left', _NAMED.right),
    ):
        unpaired = [name for name in images if words.search(name)]
        if unpaired:
            return (
                f'only {side} images: {", ".join(unpaired[:_LISTED_TOPICS])}: expected '
                f'a {other} topic of the same name and type, or --left-topic and --right-topic'
            )
    return (
        f'no stereo topics: {_contents(topics)}: expected names such as left/image_rect and '
        'right/image_rect, or --left-topic and --right-topic, or --side-by-side if each image of '
        '--left-topic shows both views'
    )


def _contents(topics: Mapping[str, str], types: tuple[str, ...] = ()) -> str:
    """List the topics of the given types, or all topics if there are none of these."""
    wanted = [name for name in topics if topics[name] in types] or list(topics)
    if not wanted:
        return 'the recording has no topics'
    listed = [f'{name} ({topics[name]})' for name in sorted(wanted)[:_LISTED_TOPICS]]
    more = len(wanted) - len(listed)
    return f'the recording has {", ".join(listed)}' + (f' and {more} more' if more else '')
