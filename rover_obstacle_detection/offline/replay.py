"""Run the detector on one recording and write detections, pictures and a summary."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from rover_obstacle_detection.bags.reader import BagReader, open_bag
from rover_obstacle_detection.bags.requested_calibration import requested_calibration
from rover_obstacle_detection.bags.stereo import BadFrame, StereoPair, StereoPairs, read_pairs
from rover_obstacle_detection.bags.topics import StereoTopics
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
from rover_obstacle_detection.offline.frame_outputs import OUTPUT_FILES, REPORT, FrameOutputs
from rover_obstacle_detection.offline.output_file import atomic_write_json, atomic_write_text
from rover_obstacle_detection.offline.output_folder import output_folder
from rover_obstacle_detection.offline.replay_options import ReplayOptions
from rover_obstacle_detection.offline.replay_report import replay_html
from rover_obstacle_detection.offline.stopwatch import Stopwatch
from rover_obstacle_detection.offline.summary import (
    READ,
    ReplayFrame,
    ReplaySummary,
)
from rover_obstacle_detection.pairing import PairingStatistics, shows_one_moment
from rover_obstacle_detection.swapped_images import detect_unswapped
from rover_obstacle_detection.wording import counted

_logger = logging.getLogger(__name__)

OnProgress = Callable[[int, int], None]
"""Called with the number of pairs done and expected."""

Stopped = Callable[[], bool]
"""Asked after each pair whether to end there."""


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

    `output` is written atomically: ``detections`` (rosbag2, mcap), ``summary.json``,
    ``obstacles.csv`` and optionally ``images``, ``overlays.mp4`` and ``report.html``. If
    `stopped`, it holds the pairs until then.

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
        topics = replace(topics, rectify=options.rectify)
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
            rate_hz = _rate_hz(bag, topics) / options.every
            with FrameOutputs(folder, topics.namespace, options, rate_hz) as outputs:
                run = _Run(topics, outputs, options, _expected_pairs(bag, topics, options))
                for pair in run.timed(pairs):
                    if not stopped():
                        run.process(pair)
                        on_progress(run.done, max(run.done, run.expected))
                    if stopped():
                        run.interrupted = True
                        break
                summary = run.summary(bag, pairs)
            if options.report:
                html = replay_html(summary, outputs.gallery, options.command_line)
                atomic_write_text(folder / REPORT, html)
            atomic_write_json(folder / 'summary.json', summary.as_json())
    return summary


class _Run:
    """The state of one replay: the detector and the results so far."""

    def __init__(
        self, topics: StereoTopics, outputs: FrameOutputs, options: ReplayOptions, expected: int
    ) -> None:
        self.expected = expected
        self.interrupted = False
        self._topics = topics
        self._outputs = outputs
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

    def process(self, pair: StereoPair | BadFrame) -> None:
        """Detect obstacles in one pair and write the result; keep why a pair is bad."""
        if isinstance(pair, BadFrame):
            self._bad_frames.append(pair)
            return
        try:
            self._detect_and_write(pair)
        except (OSError, OutputError):
            raise
        except Exception as error:
            if isinstance(error, (ConfigurationError, ModelError)) and not self._frames:
                raise
            self._take_failure(pair, error)

    def _detect_and_write(self, pair: StereoPair) -> None:
        lap = self._stopwatch.lap
        detection = detect_unswapped(
            self._detector_of(pair.camera),
            pair.left,
            pair.right,
            *pair.names,
            on_stage=lap,
        )
        number = len(self._frames) + 1
        summary = self._outputs.write(number, pair, detection, lap)
        taken_ms = self._stopwatch.take_ms()
        self._frames.append(
            ReplayFrame(number, pair.stamp_ns, summary, taken_ms, detection.warnings)
        )

    def _take_failure(self, pair: StereoPair, error: Exception) -> None:
        # Nothing is written for it: a mask would call its pixels free.
        self._outputs.discard(len(self._frames) + 1)
        _logger.debug('pair at %d ns failed', pair.stamp_ns, exc_info=error)
        reason = failure_text(error)
        if not isinstance(error, (ImageError, UnjudgeablePairError)):
            reason = f'{pair.names[0]}, {pair.names[1]}: {reason}'
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
            calibration=pairs.calibration_source,
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


def _expected_pairs(bag: BagReader, topics: StereoTopics, options: ReplayOptions) -> int:
    """Estimate the number of pairs from the message counts, for the progress bar."""
    images = min(bag.message_count(topics.left_image), bag.message_count(topics.right_image))
    length_s = max((bag.end_ns - bag.start_ns) / 1e9, 1e-9)
    wanted_s = max(length_s - options.start_s, 0.0)
    if options.duration_s is not None:
        wanted_s = min(wanted_s, options.duration_s)
    return math.ceil(images * (wanted_s / length_s) / options.every)


def _rate_hz(bag: BagReader, topics: StereoTopics) -> float:
    """Estimate the rate of the left images from the message count."""
    length_s = (bag.end_ns - bag.start_ns) / 1e9
    return (bag.message_count(topics.left_image) - 1) / length_s if length_s > 0 else 0.0


def _nothing_usable(
    path: Path,
    topics: StereoTopics,
    statistics: PairingStatistics,
    bad_frames: Sequence[BadFrame],
) -> str:
    counts = (
        f'{counted(statistics.left, "left image")} ({topics.left_image}), '
        f'{statistics.right} right ({topics.right_image}), {counted(statistics.pairs, "pair")}'
    )
    if bad_frames:
        first = bad_frames[0]
        return f'{path}: no usable pair: {counts}, {len(bad_frames)} bad: {first.reason}'
    gap_ns = statistics.smallest_gap_ns
    if gap_ns:
        gap_s = gap_ns / 1e9
        line = f'{path}: no pair: {counts}, smallest stamp gap {1000 * gap_s:.3f} ms'
        if shows_one_moment(gap_ns, statistics.spacing_ns):
            return f'{line}; try --approximate-sync {rounded_up(gap_s):g}'
        return f'{line}: the images show different moments: expected synchronised cameras'
    return f'{path}: no pair: {counts} in the selected part'


def rounded_up(value: float) -> float:
    """Round up to one significant digit."""
    unit = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / unit * 1.000001) * unit
