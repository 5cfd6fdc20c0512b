"""Reading recordings of ROS 2 (mcap, sqlite3) and ROS 1, whatever state they are in."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rover_obstacle_detection.bags.sources import Entry, Source, open_sources, read_failure
from rover_obstacle_detection.bags.topics import StereoTopics, find_stereo_topics
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import BagError, CameraError
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration


@dataclass(frozen=True)
class BadMessage:
    """A message that its type's definition cannot make sense of."""

    topic: str
    log_time_ns: int
    reason: str


class BagReader:
    """An open recording; made by `open_bag`.

    Parameters
    ----------
    path : Path
    sources : collection of Source
        Its files.
    """

    def __init__(self, path: Path, sources: Collection[Source]) -> None:
        self.path = path
        self._sources = sources
        self.topics = {
            topic: type_name for source in sources for topic, type_name in source.topics.items()
        }
        """Type of each topic."""
        spans = [source.span_ns for source in sources if source.span_ns is not None]
        self.start_ns = min((start for start, _ in spans), default=0)
        """Time of the first message; 0 if there is none."""
        self.end_ns = max((end for _, end in spans), default=0)
        """Time after the last message."""
        self.notes = tuple(note for source in sources if (note := source.note))
        """What is wrong with the recording although it can be read."""

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic; 0 if there is no such topic."""
        return sum(source.message_count(topic) for source in self._sources)

    def messages(
        self,
        topics: Collection[str],
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[tuple[str, int, Any]]:
        """Read messages in the order of their times, as they are asked for.

        Parameters
        ----------
        topics : collection of str
        start_ns, end_ns : int, optional
            From the first time, up to but without the second.

        Yields
        ------
        topic, log_time_ns, message : str, int and message or BadMessage

        Raises
        ------
        BagError
            If the recording is broken from here on.
        """
        for entry in self._entries(topics, start_ns, end_ns):
            message = _attempt(entry, entry.source.deserialize)
            yield entry.topic, entry.log_time_ns, message

    def serialized_messages(
        self,
        topics: Collection[str],
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[tuple[str, int, bytes | memoryview | BadMessage]]:
        """Read messages as `messages` does, but as ROS 2 sends them (CDR), not decoded."""
        for entry in self._entries(topics, start_ns, end_ns):
            message = _attempt(entry, entry.source.serialized)
            yield entry.topic, entry.log_time_ns, message

    def _entries(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> Iterator[Entry]:
        streams = [source.messages(topics, start_ns, end_ns) for source in self._sources]
        merged = heapq.merge(*streams, key=lambda entry: entry.log_time_ns)
        while True:
            try:
                entry = next(merged, None)
            except Exception as error:
                raise read_failure(self.path, error) from error
            if entry is None:
                return
            yield entry

    def stereo_topics(self, **given: str | None) -> StereoTopics:
        """Find the stereo camera's topics; see `find_stereo_topics`.

        Raises
        ------
        BagError
            With the recording's path in front.
        """
        try:
            return find_stereo_topics(self.topics, **given)
        except BagError as error:
            msg = f'{self.path}: {error}'
            raise BagError(msg) from None

    def calibration(self, topics: StereoTopics) -> StereoCalibration:
        """Read the first camera_info of each eye.

        Raises
        ------
        BagError
            If there is none.
        CameraError
            If no depth can be computed from them.
        """
        left, right = (
            self._first_info(image, info)
            for image, info in (
                (topics.left_image, topics.left_info),
                (topics.right_image, topics.right_info),
            )
        )
        try:
            return StereoCalibration(left, right, f'{topics.left_info} and {topics.right_info}')
        except CameraError as error:
            msg = f'{self.path}: {error}'
            raise CameraError(msg) from None

    def camera(self, topics: StereoTopics) -> StereoCamera:
        """Make the stereo camera of the first camera_info of each eye; see `calibration`."""
        return self.calibration(topics).camera

    def _first_info(self, image: str, info: str | None) -> CameraInfo:
        where = info or 'no camera_info topic'
        if info is not None:
            for _, _, message in self.messages([info]):
                if isinstance(message, BadMessage):
                    msg = f'{self.path}: {info}: {message.reason}'
                    raise BagError(msg)
                return CameraInfo.from_message(message)
            where = f'{info} has no messages'
        msg = (
            f'{self.path}: no calibration for {image} ({where}): expected sensor_msgs/CameraInfo '
            'beside it, or calibration files with --left-info and --right-info'
        )
        raise BagError(msg)


def _attempt(entry: Entry, convert: Callable[[Entry], Any]) -> Any:
    try:
        return convert(entry)
    except Exception as error:
        reason = f'{entry.type_name} cannot be decoded: {type(error).__name__}: {error}'
        return BadMessage(entry.topic, entry.log_time_ns, reason)


@contextmanager
def open_bag(path: str | Path) -> Iterator[BagReader]:
    """Open a recording.

    Parameters
    ----------
    path : str or Path
        A rosbag2 folder, one of its files (``.mcap``, ``.db3``), or a rosbag1 file (``.bag``).
        A folder whose metadata.yaml is missing and an mcap file whose end is missing, as after
        a loss of power, are read as far as they go.

    Raises
    ------
    BagError
        One line that names the path: no such recording, none at all, empty, cut short.
    """
    with ExitStack() as stack:
        yield BagReader(Path(path), open_sources(Path(path), stack))
