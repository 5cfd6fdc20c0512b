"""Read recordings of ROS 2 (mcap, sqlite3) and ROS 1, including damaged ones."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rover_obstacle_detection.bags.image_folders import ImageFolders
from rover_obstacle_detection.bags.source import Entry, Source
from rover_obstacle_detection.bags.sources import open_sources, plain_name, read_failure
from rover_obstacle_detection.bags.topics import (
    StereoTopics,
    find_stereo_topics,
    side_by_side_topics,
)
from rover_obstacle_detection.calibration_files.request import WAYS
from rover_obstacle_detection.errors import (
    BagError,
    CameraError,
    ObstacleDetectionError,
    failure_text,
)
from rover_obstacle_detection.messages.calibration import CameraInfo, StereoCalibration
from rover_obstacle_detection.wording import printable


@dataclass(frozen=True)
class BadMessage:
    """A message that cannot be decoded, and why."""

    topic: str
    log_time_ns: int
    reason: str


class BagReader:
    """An open recording; created by `open_bag`.

    Parameters
    ----------
    path : Path
    sources : collection of Source
        The files of the recording.
    """

    def __init__(self, path: Path, sources: Collection[Source]) -> None:
        self.path = path
        self._sources = sources
        self.topics = {
            topic: type_name for source in sources for topic, type_name in source.topics.items()
        }
        """Message type of each topic."""
        spans = [source.span_ns for source in sources if source.span_ns is not None]
        self.start_ns = min((start for start, _ in spans), default=0)
        """Log time of the first message; 0 if there are no messages."""
        self.end_ns = max((end for _, end in spans), default=0)
        """1 ns after the last message; 0 if there are no messages."""
        self.notes = tuple(note for source in sources if (note := source.note))
        """Damage found; the part before it can be read."""

    def message_count(self, topic: str) -> int:
        """Count the messages of a topic; 0 if the topic does not exist."""
        return sum(source.message_count(topic) for source in self._sources)

    def file_of(self, topic: str, stamp_ns: int) -> Path | None:
        """File of an image; None unless the recording is a folder of images."""
        folders = (each for each in self._sources if isinstance(each, ImageFolders))
        return next((each.file_of(topic, stamp_ns) for each in folders), None)

    def name_of(self, topic: str, stamp_ns: int) -> str:
        """Name an image in a message: by its file, or else by its topic."""
        return printable(self.file_of(topic, stamp_ns) or topic)

    def messages(
        self,
        topics: Collection[str],
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[tuple[str, int, Any]]:
        """Yield messages in time order, reading them on demand.

        Parameters
        ----------
        topics : collection of str
        start_ns, end_ns : int, optional
            Span of log times, excluding `end_ns`; the whole recording if omitted.

        Yields
        ------
        topic, log_time_ns, message : str, int, message or BadMessage

        Raises
        ------
        BagError
            If the rest of the recording cannot be read.
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
        """Yield messages as `messages` does, but in ROS 2 wire format (CDR) instead of decoded."""
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

    def stereo_topics(
        self,
        *,
        left_image: str | None = None,
        right_image: str | None = None,
        side_by_side: bool = False,
    ) -> StereoTopics:
        """Find the stereo camera's topics; see `find_stereo_topics` and `side_by_side_topics`.

        Raises
        ------
        BagError
            As `find_stereo_topics`, with the recording's path in front.
        """
        try:
            if side_by_side and left_image is not None:
                return side_by_side_topics(self.topics, left_image)
            return find_stereo_topics(self.topics, left_image=left_image, right_image=right_image)
        except BagError as error:
            raise BagError(f'{self.path}: {error}') from None

    def calibration(self, topics: StereoTopics) -> StereoCalibration:
        """Read the first camera_info of each camera.

        Raises
        ------
        BagError
            If a camera has none.
        CameraError
            If no depth can be computed from this calibration.
        """
        left, right = self.camera_infos(topics)
        try:
            return StereoCalibration(left, right, f'{topics.left_info} and {topics.right_info}')
        except CameraError as error:
            raise CameraError(f'{self.path}: {error}') from None

    def camera_infos(self, topics: StereoTopics) -> tuple[CameraInfo, CameraInfo]:
        """Read the first camera_info of each camera, whatever it says.

        Raises
        ------
        BagError
            If a camera has none.
        """
        return (
            self._first_info(topics.left_image, topics.left_info),
            self._first_info(topics.right_image, topics.right_info),
        )

    def _first_info(self, image: str, info: str | None) -> CameraInfo:
        missing = 'no camera_info topic'
        if info is not None:
            for _, _, message in self.messages([info]):
                if isinstance(message, BadMessage):
                    raise BagError(f'{self.path}: {info}: {message.reason}')
                return CameraInfo.from_message(message)
            missing = f'{info} has no messages'
        if any(isinstance(each, ImageFolders) for each in self._sources):
            raise BagError(
                f'{self.path}: no calibration beside the images: expected one given with {WAYS}'
            )
        raise BagError(
            f'{self.path}: no calibration for {image} ({missing}): expected a '
            f'sensor_msgs/CameraInfo topic next to it, or a calibration given with {WAYS}'
        )


def _attempt(entry: Entry, convert: Callable[[Entry], Any]) -> Any:
    try:
        return convert(entry)
    except OSError as error:
        reason = f'cannot be read: {error.strerror or error}'
        return BadMessage(entry.topic, entry.log_time_ns, reason)
    except Exception as error:
        reason = failure_text(error)
        if not isinstance(error, ObstacleDetectionError):
            reason = f'{entry.type_name} cannot be decoded: {reason}'
        return BadMessage(entry.topic, entry.log_time_ns, reason)


@contextmanager
def open_bag(path: str | Path) -> Iterator[BagReader]:
    """Open a recording.

    Parameters
    ----------
    path : str or Path
        A rosbag2 folder, one of its files (``.mcap``, ``.db3``; also compressed as a whole,
        ``.mcap.zstd``), or a rosbag1 file (``.bag``).
        A folder without metadata.yaml and an mcap file without its end, as left by a power loss,
        are read as far as possible.

    Raises
    ------
    BagError
        If it does not exist, is not a recording, is empty or cannot be read; one line that names
        the path.
    """
    with ExitStack() as stack:
        yield BagReader(Path(path), open_sources(Path(path), stack))


def bag_name(path: Path) -> str:
    """Return a recording's name: its folder, or its file without the suffix."""
    resolved = path.resolve()
    return resolved.name if resolved.is_dir() else Path(plain_name(resolved)).stem
