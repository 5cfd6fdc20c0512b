"""Run the detector on one recording and write detections, pictures and a summary."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rover_obstacle_detection.bags.reader import BagReader, open_bag
from rover_obstacle_detection.bags.requested_calibration import requested_calibration
from rover_obstacle_detection.bags.stereo import BadFrame, StereoPair, StereoPairs, read_pairs
from rover_obstacle_detection.bags.topics import StereoTopics
from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.errors import (
    BagError,
    ConfigurationError,
    ImageError,
    ModelError,
    NothingDoneError,
    OutputError,
    UnjudgeablePairError,
    failure_text,
)
from rover_obstacle_detection.messages.outputs import OUTPUTS
from rover_obstacle_detection.offline.output_file import atomic_write_json
from rover_obstacle_detection.offline.output_folder import output_folder
from rover_obstacle_detection.offline.picture_files import PICTURE_NAMES, write_pictures
from rover_obstacle_detection.offline.stopwatch import Stopwatch
from rover_obstacle_detection.offline.summary import (
    READ,
    WRITE_BAG,
    WRITE_IMAGES,
    FrameSummary,
    ReplayFrame,
    ReplaySummary,
)
from rover_obstacle_detection.pairing import PairingStatistics, shows_one_moment
from rover_obstacle_detection.rover_mask import RoverMask
from rover_obstacle_detection.swapped_images import detect_unswapped

_logger = logging.getLogger(__name__)

OnProgress = Callable[[int, int], None]
"""Called with the number of pairs done and expected."""

Stopped = Callable[[], bool]
"""Asked after each pair whether to end there."""

WRITTEN_OUTPUTS = ('obstacle_mask', 'obstacle_points', 'ground_points')
OUTPUT_FILES = (
    'summary.json',
    'detections/metadata.yaml',
    'detections/*.mcap',
    *(f'images/[0-9]*_{name}.png' for name in PICTURE_NAMES),
)


@dataclass(frozen=True)
class ReplayOptions:
    """What to replay and what to write.

    Parameters
    ----------
    config : DetectorConfig
    rover : RoverMask, optional
        Pixels that show the rover itself.
    left_topic, right_topic : str, optional
        Image topics; found by name if omitted.
    side_by_side : bool
        The images of `left_topic` show both views side by side.
    calibration : CalibrationRequest
        From the bag if nothing is given.
    tolerance_ns : int, optional
        Largest stamp difference of a pair; equal stamps are required if omitted.
    start_s, duration_s : float
        The part of the recording to replay, in seconds from its start.
    every : int
        Use every n-th pair.
    salvage : bool
        Replay the readable part of a damaged recording instead of refusing it.
    images : bool
        Write the pictures of each pair.
    force : bool
        Replace the files of a previous run.
    """

    config: DetectorConfig
    rover: RoverMask | None = None
    left_topic: str | None = None
    right_topic: str | None = None
    side_by_side: bool = False
    calibration: CalibrationRequest = field(default_factory=CalibrationRequest)
    tolerance_ns: int | None = None
    start_s: float = 0.0
    duration_s: float | None = None
    every: int = 1
    salvage: bool = False
    images: bool = False
    force: bool = False


def never_stopped() -> bool:
    """Return False, for a replay to the end."""
    return False


def replay_bag(
    path: Path,
    output: Path,
    options: ReplayOptions,
    on_progress: OnProgress,
    stopped: Stopped = never_stopped,
) -> ReplaySummary:
    """Run the detector on a recording and write the results.

    `output` is written atomically: ``detections`` (rosbag2, mcap), ``summary.json`` and
    optionally ``images``. If `stopped`, it holds the pairs until then.

    Raises
    ------
    NothingDoneError
        If it is stopped before a pair could be used.
    ObstacleDetectionError
        If the recording cannot be read, lacks topics or has no usable pair.
    """
    with open_bag(path) as bag:
        if bag.notes and not options.salvage:
            raise BagError(f'{bag.notes[0]}: give --salvage to replay these')
        topics = bag.stereo_topics(
            left_image=options.left_topic,
            right_image=options.right_topic,
            side_by_side=options.side_by_side,
        )
        pairs = read_pairs(
            bag,
            topics,
            calibration=requested_calibration(options.calibration, bag, topics),
            tolerance_ns=options.tolerance_ns,
            start_s=options.start_s,
            duration_s=options.duration_s,
            every=options.every,
        )
        with output_folder(output, force=options.force, replaces=OUTPUT_FILES) as folder:
            run = _Run(topics, folder, options, _expected_pairs(bag, topics, options))
            with BagWriter(folder / 'detections', compress=False) as writer:
                for pair in run.timed(pairs):
                    if not stopped():
                        run.process(pair, writer)
                        on_progress(run.done, max(run.done, run.expected))
                    if stopped():
                        run.interrupted = True
                        break
                summary = run.summary(bag, pairs)
            atomic_write_json(folder / 'summary.json', summary.as_json())
    return summary


class _Run:
    """The state of one replay: the detector and the results so far."""

    def __init__(
        self, topics: StereoTopics, folder: Path, options: ReplayOptions, expected: int
    ) -> None:
        self.expected = expected
        self.interrupted = False
        self._topics = topics
        self._folder = folder
        self._options = options
        self._stopwatch = Stopwatch()
        self._detector: Detector | None = None
        self._cameras: list[StereoCamera] = []
        self._frames: list[ReplayFrame] = []
        self._bad_frames: list[BadFrame] = []

    @property
    def done(self) -> int:
        """Number of pairs and bad messages so far."""
        return len(self._frames) + len(self._bad_frames)

    def timed(self, pairs: StereoPairs) -> Iterator[StereoPair | BadFrame]:
        """Pass the pairs on, timing how long each takes to read."""
        self._stopwatch.take_ms()
        for pair in pairs:
            self._stopwatch.lap(READ)
            yield pair
            self._stopwatch.take_ms()

    def process(self, pair: StereoPair | BadFrame, writer: BagWriter) -> None:
        """Detect obstacles in one pair and write the result; keep why a pair is bad."""
        if isinstance(pair, BadFrame):
            self._bad_frames.append(pair)
            return
        try:
            self._detect_and_write(pair, writer)
        except (OSError, OutputError):
            raise
        except Exception as error:
            if isinstance(error, (ConfigurationError, ModelError)) and not self._frames:
                raise
            self._take_failure(pair, error)

    def _detect_and_write(self, pair: StereoPair, writer: BagWriter) -> None:
        lap = self._stopwatch.lap
        detection = detect_unswapped(
            self._detector_of(pair.camera),
            pair.left,
            pair.right,
            self._topics.left_image,
            self._topics.right_image,
            on_stage=lap,
        )
        # All messages before the first is written: a frame is in the bag as a whole or not at all.
        messages = [
            (name, OUTPUTS[name].encode(detection, pair.left_header, writer.factory))
            for name in WRITTEN_OUTPUTS
        ]
        summary = FrameSummary.of(detection)
        lap(WRITE_BAG)
        number = len(self._frames) + 1
        if self._options.images:
            write_pictures(detection, pair.left, self._folder / 'images', _prefix(number))
            lap(WRITE_IMAGES)
        for name, message in messages:
            topic = f'{self._topics.namespace}/{name}'
            writer.add(topic, OUTPUTS[name].type_name, message, pair.stamp_ns)
        lap(WRITE_BAG)
        taken_ms = self._stopwatch.take_ms()
        self._frames.append(
            ReplayFrame(number, pair.stamp_ns, summary, taken_ms, detection.warnings)
        )

    def _take_failure(self, pair: StereoPair, error: Exception) -> None:
        # Nothing is written for it: a mask would call its pixels free.
        for picture in (self._folder / 'images').glob(f'{_prefix(len(self._frames) + 1)}*'):
            picture.unlink()
        _logger.debug('pair at %d ns failed', pair.stamp_ns, exc_info=error)
        reason = failure_text(error)
        if not isinstance(error, (ImageError, UnjudgeablePairError)):
            reason = f'{self._topics.left_image}, {self._topics.right_image}: {reason}'
        unjudgeable = isinstance(error, UnjudgeablePairError)
        self._bad_frames.append(
            BadFrame(pair.stamp_ns, self._topics.left_image, reason, unjudgeable)
        )

    def summary(self, bag: BagReader, pairs: StereoPairs) -> ReplaySummary:
        """Return the summary, or raise an error if no pair could be used."""
        statistics = pairs.statistics
        if not self._frames and self.interrupted:
            raise NothingDoneError(f'no usable pair of {bag.path} so far: nothing is kept')
        if not self._frames:
            raise BagError(_nothing_usable(bag.path, self._topics, statistics, self._bad_frames))
        return ReplaySummary(
            bag=str(bag.path),
            notes=bag.notes,
            topics=self._topics,
            cameras=tuple(self._cameras),
            config=self._options.config,
            statistics=statistics,
            frames=tuple(self._frames),
            bad_frames=tuple(self._bad_frames),
            expected=self.expected,
            interrupted=self.interrupted,
        )

    def _detector_of(self, camera: StereoCamera) -> Detector:
        if self._detector is None or self._detector.camera != camera:
            rover = self._options.rover
            pixels = rover.pixels(*camera.shape) if rover else None
            self._detector = Detector(camera, self._options.config, pixels)
            if camera not in self._cameras:
                self._cameras.append(camera)
        return self._detector


def _prefix(number: int) -> str:
    return f'{number:06d}_'


def _expected_pairs(bag: BagReader, topics: StereoTopics, options: ReplayOptions) -> int:
    """Estimate the number of pairs from the message counts, for the progress bar."""
    images = min(bag.message_count(topics.left_image), bag.message_count(topics.right_image))
    length_s = max((bag.end_ns - bag.start_ns) / 1e9, 1e-9)
    wanted_s = max(length_s - options.start_s, 0.0)
    if options.duration_s is not None:
        wanted_s = min(wanted_s, options.duration_s)
    return math.ceil(images * (wanted_s / length_s) / options.every)


def _nothing_usable(
    path: Path,
    topics: StereoTopics,
    statistics: PairingStatistics,
    bad_frames: Sequence[BadFrame],
) -> str:
    counts = (
        f'{statistics.left} left images ({topics.left_image}), '
        f'{statistics.right} right ({topics.right_image}), {statistics.pairs} pairs'
    )
    if bad_frames:
        first = bad_frames[0]
        return f'{path}: no usable pair: {counts}, {len(bad_frames)} bad: {first.reason}'
    gap_ns = statistics.smallest_gap_ns
    if gap_ns:
        gap_s = gap_ns / 1e9
        line = f'{path}: no pair: {counts}, smallest stamp gap {1000 * gap_s:.3f} ms'
        if shows_one_moment(gap_ns, statistics.spacing_ns):
            return f'{line}; try --approximate-sync {_rounded_up(gap_s):g}'
        return f'{line}: the images show different moments: expected synchronised cameras'
    return f'{path}: no pair: {counts} in the selected part'


def _rounded_up(value: float) -> float:
    """Round up to one significant digit."""
    unit = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / unit * 1.000001) * unit
