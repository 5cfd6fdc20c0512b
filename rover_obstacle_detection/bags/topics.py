"""The stereo camera's topics in a recording, found by their names or given."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import takewhile

from rover_obstacle_detection.errors import BagError

IMAGE_TYPE = 'sensor_msgs/msg/Image'
COMPRESSED_TYPE = 'sensor_msgs/msg/CompressedImage'
INFO_TYPE = 'sensor_msgs/msg/CameraInfo'

_EYES = {'left': 'right', 'infra1': 'infra2'}
_LEFT_WORD = re.compile(rf'(?<![a-z])({"|".join(_EYES)})(?![a-z0-9])', re.I)
_RIGHT_WORD = re.compile(rf'(?<![a-z])({"|".join(_EYES.values())})(?![a-z0-9])', re.I)
# Words of a path component that tell of the image, not of the camera: left_raw is left's raw.
_IMAGE_WORDS = re.compile(
    r'(?<![a-z])(camera_info|image|raw|rect|colou?r|gr[ae]y|mono)(?![a-z])', re.I
)
_OTHER_PICTURES = re.compile(
    r'depth|disparity|mask|label|instance|segment|semantic|confidence|normal|debug|detection', re.I
)
_TRANSPORT = '/compressed'
_LISTED = 12


@dataclass(frozen=True)
class StereoTopics:
    """The four topics of one stereo camera; an info topic is None where there is none."""

    left_image: str
    right_image: str
    left_info: str | None = None
    right_info: str | None = None

    @property
    def namespace(self) -> str:
        """What the image topics have in common before the eye: ``/stereo``, or empty."""
        parts = zip(self.left_image.split('/'), self.right_image.split('/'), strict=False)
        return '/'.join(left for left, _ in takewhile(lambda pair: pair[0] == pair[1], parts))

    @property
    def is_rectified(self) -> bool:
        """Whether the images are rectified by ROS's convention: ``rect`` in the name."""
        return all('rect' in _base_name(name) for name in (self.left_image, self.right_image))


def find_stereo_topics(
    topics: Mapping[str, str],
    *,
    left_image: str | None = None,
    right_image: str | None = None,
    left_info: str | None = None,
    right_info: str | None = None,
) -> StereoTopics:
    """Find the topics of the stereo camera.

    Rectified images are preferred over raw ones, grey over colour, uncompressed over compressed.

    Parameters
    ----------
    topics : mapping of str to str
        Type of each topic of the recording.
    left_image, right_image, left_info, right_info : str, optional
        Topics to take instead of looking for them by name.

    Raises
    ------
    BagError
        If there is no stereo camera, more than one, or a given topic is not there: with the
        topics that there are.
    """
    _check_given(topics, (left_image, right_image), (IMAGE_TYPE, COMPRESSED_TYPE))
    _check_given(topics, (left_info, right_info), (INFO_TYPE,))
    if left_image is None or right_image is None:
        left_image, right_image = _find_images(topics, left_image, right_image)
    if left_image == right_image:
        msg = f'left and right are both {left_image}: expected two topics'
        raise BagError(msg)
    left_found = _find_info(topics, left_image, _LEFT_WORD)
    right_found = _find_info(topics, right_image, _RIGHT_WORD)
    if left_found == right_found:
        # One camera_info beside both images can be neither eye's for sure.
        left_found = right_found = None
    return StereoTopics(
        left_image, right_image, left_info or left_found, right_info or right_found
    )


def _check_given(
    topics: Mapping[str, str], names: Iterable[str | None], types: tuple[str, ...]
) -> None:
    for name in names:
        if name is None:
            continue
        if name not in topics:
            msg = f'no topic {name}: {_contents(topics, types)}'
            raise BagError(msg)
        if topics[name] not in types:
            msg = f'topic {name} is {topics[name]}: expected {" or ".join(types)}'
            raise BagError(msg)


def _find_images(
    topics: Mapping[str, str], left: str | None, right: str | None
) -> tuple[str, str]:
    pairs = _image_pairs(topics)
    if left is not None or right is not None:
        pairs = [pair for pair in pairs if left == pair[0] or right == pair[1]]
        if not pairs:
            given, other = (left, 'right') if left is not None else (right, 'left')
            msg = f'no {other} partner of {given}: choose it with --{other}-topic; '
            raise BagError(msg + _contents(topics))
        return pairs[0]
    cameras: dict[str, list[tuple[str, str]]] = {}
    for pair in pairs:
        cameras.setdefault(_camera_key(pair[0], _LEFT_WORD), []).append(pair)
    if not cameras:
        raise BagError(_no_pair(topics))
    best = [min(each, key=lambda pair: _rank(pair[0], topics)) for each in cameras.values()]
    if len(best) > 1:
        listed = '; '.join(f'{one} and {other}' for one, other in sorted(best))
        msg = f'{len(best)} stereo cameras: {listed}: '
        raise BagError(msg + 'choose one with --left-topic and --right-topic')
    return best[0]


def _image_pairs(topics: Mapping[str, str]) -> list[tuple[str, str]]:
    pairs = []
    for name in sorted(topics):
        if not _is_camera_image(name, topics):
            continue
        for partner in _partners(name):
            if topics.get(partner) == topics[name]:
                pairs.append((name, partner))
                break
    return pairs


def _partners(left: str) -> list[str]:
    """Names of the right topic that a left one may have: one word exchanged, or all of them."""
    words = list(_LEFT_WORD.finditer(left))
    one = [
        left[: word.start()] + _opposite(word.group()) + left[word.end() :]
        for word in reversed(words)
    ]
    return [*one, _LEFT_WORD.sub(lambda word: _opposite(word.group()), left)] if words else []


def _opposite(eye: str) -> str:
    opposite = _EYES[eye.lower()]
    if eye.isupper():
        return opposite.upper()
    return opposite.capitalize() if eye[0].isupper() else opposite


def _is_camera_image(name: str, topics: Mapping[str, str]) -> bool:
    if topics[name] not in (IMAGE_TYPE, COMPRESSED_TYPE):
        return False
    # What comes before the eye is a namespace and says nothing of the picture.
    eye = _LEFT_WORD.search(name) or _RIGHT_WORD.search(name)
    return not _OTHER_PICTURES.search(name, name.rfind('/', 0, eye.start()) + 1 if eye else 0)


def _base_name(topic: str) -> str:
    return topic.removesuffix(_TRANSPORT).rpartition('/')[2].lower()


def _rank(topic: str, topics: Mapping[str, str]) -> tuple[int, bool, str]:
    base = _base_name(topic)
    if base == 'image_rect':
        kind = 0
    elif 'rect' in base:
        kind = 2 if 'col' in base else 1
    else:
        kind = 3 if 'raw' in base else 4
    return kind, topics[topic] == COMPRESSED_TYPE, topic


def _camera_key(topic: str, eye: re.Pattern[str]) -> str:
    """Name of the camera that a topic belongs to: its path up to and without the eye."""
    words = list(eye.finditer(topic))
    if not words:
        return topic
    word = words[-1]
    start = topic.rfind('/', 0, word.start()) + 1
    end = topic.find('/', word.end())
    component = topic[start:] if end < 0 else topic[start:end]
    rest = _IMAGE_WORDS.sub('', eye.sub('', component)).strip('_')
    return topic[:start] + rest


def _find_info(topics: Mapping[str, str], image: str, eye: re.Pattern[str]) -> str | None:
    beside = image.removesuffix(_TRANSPORT).rpartition('/')[0] + '/camera_info'
    if topics.get(beside) == INFO_TYPE:
        return beside
    key = _camera_key(image, eye)
    same = [
        name
        for name, type_name in sorted(topics.items())
        if type_name == INFO_TYPE and eye.search(name) and _camera_key(name, eye) == key
    ]
    return same[0] if same else None


def _no_pair(topics: Mapping[str, str]) -> str:
    images = [name for name in sorted(topics) if _is_camera_image(name, topics)]
    for eye, other, words in (
        ('left', 'right', _LEFT_WORD),
        ('right', 'left', _RIGHT_WORD),
    ):
        lonely = [name for name in images if words.search(name)]
        if lonely:
            return (
                f'only images of the {eye} eye: {", ".join(lonely[:_LISTED])}: expected '
                f'a {other} one of the same name and type, or --left-topic and --right-topic'
            )
    return (
        f'no stereo topics: {_contents(topics)}: expected names such as left/image_rect and '
        'right/image_rect, or --left-topic and --right-topic'
    )


def _contents(topics: Mapping[str, str], types: tuple[str, ...] = ()) -> str:
    wanted = [name for name in topics if topics[name] in types] or list(topics)
    if not wanted:
        return 'it holds no topics'
    listed = [f'{name} ({topics[name]})' for name in sorted(wanted)[:_LISTED]]
    more = len(wanted) - len(listed)
    return f'it holds {", ".join(listed)}' + (f' and {more} more' if more else '')
