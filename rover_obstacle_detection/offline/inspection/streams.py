"""The images of one camera of a recording, and whether left and right belong together."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.reader import BadMessage, BagReader
from rover_obstacle_detection.messages.calibration import CameraInfo
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.messages.image_header import declared_size
from rover_obstacle_detection.offline.replay import rounded_up
from rover_obstacle_detection.pairing import Pair, StereoPairing, shows_one_moment
from rover_obstacle_detection.wording import counted, printable

# With fewer equal stamps than this share of the images, a tolerance may find more pairs.
_EQUAL_SHARE = 0.9
# Half of the images of cameras that run freely are near to another one by chance.
_NEAR_SHARE = 0.75
_QUEUE_SIZE = 30


@dataclass
class Stream:
    """The images of one topic.

    Parameters
    ----------
    topic, type_name : str
    images : int
        Messages that are decoded and have a stamp.
    bad : list of str
        Why the others are not.
    encodings, sizes : set of str
        For example mono8 and 640 x 480.
    repeats : int
        Images with the bytes of the one before, unless they have a single grey level.
    stamps_ns, log_times_ns : list of int
        Of the images, as recorded.
    """

    topic: str
    type_name: str
    bad: list[str] = field(default_factory=list)
    encodings: set[str] = field(default_factory=set)
    sizes: set[str] = field(default_factory=set)
    repeats: int = 0
    stamps_ns: list[int] = field(default_factory=list)
    log_times_ns: list[int] = field(default_factory=list)
    _latest: NDArray[Any] | None = None

    @property
    def images(self) -> int:
        """Number of images."""
        return len(self.stamps_ns)

    @property
    def spacing_ns(self) -> int | None:
        """Median time between two images."""
        spacings = np.diff(np.unique(self.stamps_ns))
        return int(np.median(spacings)) if spacings.size else None

    @property
    def rate_hz(self) -> float | None:
        """Images per second."""
        return 1e9 / self.spacing_ns if self.spacing_ns else None

    def take(self, log_time_ns: int, message: Any, name: str = '') -> None:
        """Add a message; the reason why it is bad begins with `name`."""
        if reason := self._take(log_time_ns, message):
            self.bad.append(f'{name}: {reason}' if name else reason)

    def _take(self, log_time_ns: int, message: Any) -> str:
        """Add a message unless it is bad; return why it is."""
        if isinstance(message, BadMessage):
            return message.reason
        stamp = stamp_ns(message.header)
        if stamp <= 0:
            return f'header.stamp is {stamp / 1e9:g} s: expected more than 0'
        data = np.frombuffer(message.data, np.uint8)
        try:
            width, height = _size(message)
        except ValueError as error:
            return f'{error}, got {counted(data.size, "byte")}'
        self.sizes.add(f'{width} x {height}')
        self.encodings.add(str(getattr(message, 'encoding', None) or message.format).strip())
        if self._latest is not None and np.array_equal(data, self._latest):
            self.repeats += bool(data.size and data.min() != data.max())
        self._latest = data
        self.stamps_ns.append(stamp)
        self.log_times_ns.append(log_time_ns)
        return ''


def _size(message: Any) -> tuple[int, int]:
    if hasattr(message, 'encoding'):
        return int(message.width), int(message.height)
    return declared_size(bytes(message.data))


@dataclass
class InfoStream:
    """The camera_info messages of one topic.

    Parameters
    ----------
    messages : int
    changes : int
        Messages with another calibration than the one before.
    """

    messages: int = 0
    changes: int = 0
    _latest: CameraInfo | None = None

    def take(self, message: Any) -> None:
        """Add a message."""
        self.messages += 1
        if isinstance(message, BadMessage):
            return
        info = CameraInfo.from_message(message)
        self.changes += self._latest is not None and info != self._latest
        self._latest = info


def read_streams(
    bag: BagReader, image_topics: Collection[str], info_topics: Collection[str]
) -> tuple[dict[str, Stream], dict[str, InfoStream]]:
    """Read a recording to its end.

    Raises
    ------
    BagError
        If the rest of the recording cannot be read.
    """
    streams = {topic: Stream(topic, bag.topics[topic]) for topic in image_topics}
    infos = {topic: InfoStream() for topic in info_topics}
    for topic, log_time_ns, message in bag.messages({*streams, *infos}):
        if topic in streams:
            file = bag.file_of(topic, log_time_ns)
            streams[topic].take(log_time_ns, message, printable(file or ''))
        else:
            infos[topic].take(message)
    return streams, infos


@dataclass(frozen=True)
class Synchronisation:
    """Whether left and right images are of the same moments.

    Parameters
    ----------
    equal_stamps : int
        Pairs of the same stamp.
    smallest_gap_ms, median_gap_ms : float or None
        From the stamps of the side with fewer images to the nearest ones of the other; None
        without images on both sides.
    approximate_sync_s : float or None
        The tolerance to give; None if stamps are equal or nothing helps.
    pairs : int
        Pairs with that tolerance.
    """

    equal_stamps: int
    smallest_gap_ms: float | None
    median_gap_ms: float | None
    approximate_sync_s: float | None
    pairs: int


def synchronise(left: Stream, right: Stream) -> tuple[Synchronisation, list[Pair]]:
    """Pair two streams, with a tolerance if their stamps need one; items are log times."""
    left_ns, right_ns = np.unique(left.stamps_ns), np.unique(right.stamps_ns)
    if not (left_ns.size and right_ns.size):
        return Synchronisation(0, None, None, None, 0), []
    few_ns, many_ns = sorted((left_ns, right_ns), key=len)
    after = np.clip(np.searchsorted(many_ns, few_ns), 1, max(many_ns.size - 1, 1))
    nearest = np.stack([many_ns[after - 1], many_ns[np.minimum(after, many_ns.size - 1)]])
    gaps_ns = np.abs(nearest - few_ns).min(axis=0)
    equal = int(np.count_nonzero(gaps_ns == 0))
    spacings = [each for each in (left.spacing_ns, right.spacing_ns) if each]
    spacing_ns = min(spacings, default=None)
    near = [int(gap) for gap in gaps_ns if shows_one_moment(int(gap), spacing_ns)]
    farthest_ns = max(near, default=0)
    tolerance_s = None
    is_near = len(near) >= _NEAR_SHARE * gaps_ns.size
    if farthest_ns and is_near and equal < _EQUAL_SHARE * gaps_ns.size:
        tolerance_s = rounded_up(farthest_ns / 1e9)
    pairs = _pairs(left, right, None if tolerance_s is None else round(1e9 * tolerance_s))
    return (
        Synchronisation(
            equal,
            float(gaps_ns.min()) / 1e6,
            float(np.median(gaps_ns)) / 1e6,
            tolerance_s,
            len(pairs),
        ),
        pairs,
    )


def in_order(left: Stream, right: Stream) -> list[Pair]:
    """Pair the images in their order, whatever their stamps."""
    sides = (zip(each.log_times_ns, each.stamps_ns, strict=True) for each in (left, right))
    return [
        Pair(one[1], one, other, abs(one[1] - other[1]))
        for one, other in zip(*sides, strict=False)
    ]


def _pairs(left: Stream, right: Stream, tolerance_ns: int | None) -> list[Pair]:
    pairing = StereoPairing(tolerance_ns, _QUEUE_SIZE)
    events = sorted(
        (log_time_ns, is_right, stamp)
        for is_right, stream in enumerate((left, right))
        for log_time_ns, stamp in zip(stream.log_times_ns, stream.stamps_ns, strict=True)
    )
    pairs = []
    for log_time_ns, is_right, stamp in events:
        add = pairing.add_right if is_right else pairing.add_left
        pair = add(stamp, (log_time_ns, stamp))
        if pair is not None:
            pairs.append(pair)
    return [*pairs, *pairing.flush()]
