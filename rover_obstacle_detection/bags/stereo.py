"""Read decoded, rectified stereo pairs from a recording, with their camera."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rover_obstacle_detection.bags.calibration_watch import CalibrationWatch
from rover_obstacle_detection.bags.extras import Extras
from rover_obstacle_detection.bags.reader import BadMessage, BagReader
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import BagError, CameraError, ImageError, failure_text
from rover_obstacle_detection.messages.calibration import StereoCalibration
from rover_obstacle_detection.messages.header import (
    NANOSECONDS_PER_SECOND,
    make_header,
    stamp_ns,
)
from rover_obstacle_detection.messages.image import OVERSIZE, decode_camera_image, halves
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory
from rover_obstacle_detection.pairing import Pair, PairingStatistics, StereoPairing
from rover_obstacle_detection.wording import counted, printable

_logger = logging.getLogger(__name__)

# Images that wait for their partner; one second at 30 Hz.
_QUEUE_SIZE = 30
_LISTED_FILES = 5


@dataclass(frozen=True, eq=False)
class StereoPair:
    """A decoded, rectified stereo pair.

    Parameters
    ----------
    stamp_ns : int
        Stamp of the left image.
    frame_id : str
        Frame of the left image.
    left, right : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.
    left_header : std_msgs/Header
        Header of the left image, as a message for `BagWriter`.
    camera : StereoCamera
    names : tuple of str
        What to call the left and the right image in messages: their files or topics.
    extras : mapping of str to message
        Message of each extra topic with the left image's stamp; topics without one are absent.
    """

    stamp_ns: int
    frame_id: str
    left: NDArray[Any]
    right: NDArray[Any]
    left_header: Any
    camera: StereoCamera
    names: tuple[str, str] = ('left', 'right')
    extras: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class BadFrame:
    """A message or pair that cannot be used, and why.

    Parameters
    ----------
    stamp_ns : int
    topic : str
    reason : str
    unjudgeable : bool
        Whether it is a decoded pair that the detector cannot judge.
    """

    stamp_ns: int
    topic: str
    reason: str
    unjudgeable: bool = False


def read_pairs(
    bag: BagReader,
    topics: StereoTopics,
    *,
    calibration: StereoCalibration | None = None,
    tolerance_ns: int | None = None,
    start_s: float = 0.0,
    duration_s: float | None = None,
    every: int = 1,
    extra_topics: Sequence[str] = (),
) -> StereoPairs:
    """Iterate over the stereo pairs of a recording, decoding them on demand.

    Images are rectified if their topics have no ``rect`` in the name.

    Parameters
    ----------
    bag : BagReader
    topics : StereoTopics
    calibration : StereoCalibration, optional
        Replaces the recording's camera_info.
    tolerance_ns : int, optional
        Largest stamp difference of a pair; None requires equal stamps.
    start_s, duration_s : float, optional
        The part of the recording to read, in seconds from its start.
    every : int
        Decode and return only every n-th pair.
    extra_topics : sequence of str
        Topics whose messages are attached to the pair with the same stamp.

    Raises
    ------
    BagError
        If there is no calibration. While iterating, if the recording cannot be read further or
        the first images do not have the calibration's size.
    CameraError
        If no depth can be computed from the calibration.
    """
    infos = () if calibration else (topics.left_info, topics.right_info)
    info_topics = {name for name in infos if name is not None}
    watch = CalibrationWatch(
        calibration or bag.calibration(topics), topics, info_topics, tolerance_ns or 0
    )
    return StereoPairs(
        bag,
        topics,
        watch,
        StereoPairing(tolerance_ns, _QUEUE_SIZE),
        window_ns=_window_ns(bag, start_s, duration_s),
        every=every,
        extras=Extras([topic for topic in extra_topics if topic in bag.topics]),
    )


class StereoPairs(Iterator['StereoPair | BadFrame']):
    """The pairs of a recording and the counts so far; see `read_pairs`."""

    def __init__(
        self,
        bag: BagReader,
        topics: StereoTopics,
        watch: CalibrationWatch,
        pairing: StereoPairing,
        *,
        window_ns: tuple[int, int],
        every: int,
        extras: Extras[StereoPair | BadFrame],
    ) -> None:
        self._bag = bag
        self._topics = topics
        self._watch = watch
        self._pairing = pairing
        self._window_ns = window_ns
        self._every = every
        self._extras = extras
        self._factory = RosbagsFactory()
        self._seen_pairs = 0
        self._decoded_pairs = 0
        self._lone_files: dict[Path, None] = {}
        self._frames = self._read()
        self.bad_frames = 0
        """Number of messages and pairs that could not be used so far."""

    @property
    def statistics(self) -> PairingStatistics:
        """Counts of received, paired and unmatched images so far."""
        return self._pairing.statistics

    @property
    def calibration_source(self) -> str:
        """The files, topics and numbers that the calibration comes from."""
        return self._watch.source

    def __next__(self) -> StereoPair | BadFrame:
        frame = next(self._frames)
        self.bad_frames += isinstance(frame, BadFrame)
        return frame

    def _read(self) -> Iterator[StereoPair | BadFrame]:
        for topic, log_time_ns, message in self._bag.messages(self._wanted(), *self._window_ns):
            try:
                for frame in self._take(topic, log_time_ns, message):
                    self._extras.hold(frame.stamp_ns, log_time_ns, frame)
            except Exception as error:
                bad = self._failure(log_time_ns, topic, error)
                self._extras.hold(bad.stamp_ns, log_time_ns, bad)
            yield from self._with_extras(log_time_ns)
        for pair in self._pairing.flush():
            for frame in self._take_pair(pair):
                self._extras.hold(frame.stamp_ns, self._window_ns[1], frame)
        yield from self._with_extras(None)
        if self._lone_files:
            self._warn_of_lone_files()

    def _wanted(self) -> set[str]:
        images = {self._topics.left_image, self._topics.right_image}
        return images | self._watch.info_topics | set(self._extras.topics)

    def _with_extras(self, log_time_ns: int | None) -> Iterator[StereoPair | BadFrame]:
        for frame, extras in self._extras.ready(log_time_ns):
            yield replace(frame, extras=extras) if isinstance(frame, StereoPair) else frame

    def _take(self, topic: str, log_time_ns: int, message: Any) -> Iterator[StereoPair | BadFrame]:
        if isinstance(message, BadMessage):
            name = self._bag.name_of(topic, log_time_ns)
            yield BadFrame(log_time_ns, topic, f'{name}: {message.reason}')
        elif topic in (self._topics.left_image, self._topics.right_image):
            yield from self._take_image(topic, log_time_ns, message)
        elif topic in self._extras.topics:
            self._extras.take(topic, message)
        else:
            self._watch.take(topic, message)

    def _take_image(
        self, topic: str, log_time_ns: int, message: Any
    ) -> Iterator[StereoPair | BadFrame]:
        stamp = stamp_ns(message.header)
        if stamp <= 0:
            stamp_s = stamp / NANOSECONDS_PER_SECOND
            reason = f'{topic}: header.stamp is {stamp_s:g} s: expected more than 0'
            yield BadFrame(log_time_ns, topic, reason)
            return
        if file := self._bag.file_of(topic, stamp):
            self._lone_files[file] = None
        # An image with both views is that of both topics.
        for name, add in (
            (self._topics.left_image, self._pairing.add_left),
            (self._topics.right_image, self._pairing.add_right),
        ):
            pair = add(stamp, message) if topic == name else None
            if pair is not None:
                yield from self._take_pair(pair)

    def _take_pair(self, pair: Pair) -> Iterator[StereoPair | BadFrame]:
        self._seen_pairs += 1
        topics = self._topics.left_image, self._topics.right_image
        names = self._names(pair, topics)
        if (self._seen_pairs - 1) % self._every:
            return
        failing = 0
        try:
            most_pixels = OVERSIZE * math.prod(self._watch.camera.shape)
            left = decode_camera_image(pair.left, names[0], most_pixels)
            failing = 1
            if self._topics.is_side_by_side:
                left, right = halves(left, names[1])
            else:
                right = decode_camera_image(pair.right, names[1], most_pixels)
            self._check_sizes(left, right, names)
            left, right = self._watch.rectify(left, right)
        except Exception as error:
            yield self._failure(pair.stamp_ns, topics[failing], error, names[failing])
            return
        self._decoded_pairs += 1
        frame_id = str(pair.left.header.frame_id)
        yield StereoPair(
            stamp_ns=pair.stamp_ns,
            frame_id=frame_id,
            left=left,
            right=right,
            left_header=make_header(pair.stamp_ns, frame_id, self._factory),
            camera=self._watch.camera,
            names=names,
        )

    def _names(self, pair: Pair, topics: tuple[str, str]) -> tuple[str, str]:
        """Name the images of a pair; their files are no longer without partner."""
        names = []
        for topic, image in zip(topics, (pair.left, pair.right), strict=True):
            stamp = stamp_ns(image.header)
            names.append(self._bag.name_of(topic, stamp))
            if file := self._bag.file_of(topic, stamp):
                self._lone_files.pop(file, None)
        return names[0], names[1]

    def _warn_of_lone_files(self) -> None:
        first = ', '.join(printable(file) for file in islice(self._lone_files, _LISTED_FILES))
        more = len(self._lone_files) - _LISTED_FILES
        others = f' and {counted(more, "other")}' if more > 0 else ''
        _logger.warning('no partner for %s%s', first, others)

    def _failure(self, stamp_ns: int, topic: str, error: Exception, name: str = '') -> BadFrame:
        """Take an error for that of one message or pair; raise it if it concerns all of them."""
        if isinstance(error, BagError):
            raise error
        _logger.debug('%s at %d ns failed', topic, stamp_ns, exc_info=error)
        reason = failure_text(error)
        if not isinstance(error, (CameraError, ImageError)):
            reason = f'{name or topic}: {reason}'
        return BadFrame(stamp_ns, topic, reason)

    def _check_sizes(
        self, left: NDArray[Any], right: NDArray[Any], names: tuple[str, str]
    ) -> None:
        check_equal_sizes(left, right, names)
        expected = self._watch.camera.shape
        if left.shape[:2] == expected:
            return
        msg = (
            f'{names[0]} and {names[1]} are {_size(left.shape)}, '
            f'but the calibration ({self._watch.source}) is for {_size(expected)}: '
            'expected the same size'
        )
        if self._decoded_pairs:
            raise ImageError(msg)
        # If the first pair does not fit, the calibration is wrong, not the frame.
        raise BagError(f'{self._bag.path}: {msg}')


def check_equal_sizes(left: NDArray[Any], right: NDArray[Any], names: Sequence[str]) -> None:
    """Check that the images of a pair have one size.

    Parameters
    ----------
    left, right : ndarray, shape (height, width) or (height, width, 3)
    names : sequence of two str
        What to call them.

    Raises
    ------
    ImageError
        If they differ in size.
    """
    if left.shape[:2] != right.shape[:2]:
        raise ImageError(
            f'{names[1]} is {_size(right.shape)}, {names[0]} is {_size(left.shape)}: '
            'expected the same size'
        )


def _size(shape: tuple[int, ...]) -> str:
    return f'{shape[1]} x {shape[0]}'


def _window_ns(bag: BagReader, start_s: float, duration_s: float | None) -> tuple[int, int]:
    start_ns = bag.start_ns + round(start_s * NANOSECONDS_PER_SECOND)
    if duration_s is None:
        return start_ns, bag.end_ns
    return start_ns, min(bag.end_ns, start_ns + round(duration_s * NANOSECONDS_PER_SECOND))
