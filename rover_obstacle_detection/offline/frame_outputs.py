"""Write the results of each judged pair: a frame is in every output or in none."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

from rover_obstacle_detection.bags.stereo import StereoPair
from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.offline.bag_messages import frame_messages
from rover_obstacle_detection.offline.obstacles_csv import ObstacleTable
from rover_obstacle_detection.offline.overlay_video import OverlayVideo
from rover_obstacle_detection.offline.picture_files import (
    PICTURE_NAMES,
    encode_jpeg,
    write_pictures,
)
from rover_obstacle_detection.offline.replay_gallery import Gallery, report_pictures
from rover_obstacle_detection.offline.replay_options import ReplayOptions
from rover_obstacle_detection.offline.summary import (
    CLOUDS,
    WRITE_BAG,
    WRITE_IMAGES,
    FrameSummary,
    ReplayFrame,
)
from rover_obstacle_detection.pictures import overlay_picture, shown_obstacles

REPORT = 'report.html'
VIDEO = 'overlays.mp4'
OUTPUT_FILES = (
    'summary.json',
    'obstacles.csv',
    REPORT,
    VIDEO,
    'detections/metadata.yaml',
    'detections/*.mcap',
    *(f'images/[0-9]*_{name}.png' for name in PICTURE_NAMES),
)
"""Glob patterns of all that a replay writes."""


class FrameOutputs:
    """The files of a replay that grow with each frame. Use it as a context manager.

    Parameters
    ----------
    folder : Path
    namespace : str
        Of the topics in the bag.
    options : ReplayOptions
    rate_hz : float
        Of the video.
    """

    def __init__(
        self, folder: Path, namespace: str, options: ReplayOptions, rate_hz: float
    ) -> None:
        self.gallery = Gallery()
        self._folder = folder
        self._namespace = namespace
        self._options = options
        self._rate_hz = rate_hz
        self._video: OverlayVideo | None = None
        self._stack = ExitStack()

    def __enter__(self) -> FrameOutputs:
        with ExitStack() as stack:
            self._bag = stack.enter_context(BagWriter(self._folder / 'detections', compress=False))
            self._table = stack.enter_context(ObstacleTable(self._folder / 'obstacles.csv'))
            if self._options.video:
                video = OverlayVideo(self._folder / VIDEO, self._rate_hz)
                self._video = stack.enter_context(video)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stack.__exit__(exc_type, exc_value, traceback)

    def write(
        self, number: int, pair: StereoPair, detection: Detection, lap: Callable[[str], None]
    ) -> FrameSummary:
        """Write a frame and return its figures; `lap` is called at the end of each stage."""
        obstacles = shown_obstacles(detection)
        summary = FrameSummary.of(detection)
        # Computed on first access; here, so that they do not count as writing.
        _ = detection.obstacle_points, detection.ground_points, detection.grid
        lap(CLOUDS)
        overlay = overlay_picture(detection, pair.left)
        lap(WRITE_IMAGES)
        # All messages before the first is written: a frame is in the bag as a whole or not at all.
        messages = tuple(
            frame_messages(
                self._namespace,
                pair.left_header,
                detection,
                summary,
                encode_jpeg(overlay),
                self._bag.factory,
            )
        )
        lap(WRITE_BAG)
        if self._options.images:
            folder, names = self._folder / 'images', self._options.images
            write_pictures(detection, pair.left, folder, _prefix(number), names)
        if self._options.report:
            frame = ReplayFrame(number, pair.stamp_ns, summary, {}, detection.warnings)
            self.gallery.offer(frame, lambda: report_pictures(detection, overlay))
        if self._options.images or self._options.report:
            lap(WRITE_IMAGES)
        for topic, type_name, message in messages:
            self._bag.add(topic, type_name, message, pair.stamp_ns)
        self._table.add(number, pair.stamp_ns, obstacles)
        lap(WRITE_BAG)
        if self._video:
            # Last, because it cannot be taken back if the frame fails.
            self._video.add(overlay)
            lap(WRITE_IMAGES)
        return summary

    def discard(self, number: int) -> None:
        """Remove what a frame that failed has left behind."""
        for picture in (self._folder / 'images').glob(f'{_prefix(number)}*'):
            picture.unlink()
        self.gallery.discard(number)


def _prefix(number: int) -> str:
    return f'{number:06d}_'
