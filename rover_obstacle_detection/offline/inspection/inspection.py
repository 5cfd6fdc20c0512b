"""Inspect a recording: what it holds, what it lacks, and how to replay it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from rover_obstacle_detection.bags.reader import BagReader, bag_name, open_bag
from rover_obstacle_detection.bags.topics import StereoTopics, stereo_cameras
from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.errors import BagError
from rover_obstacle_detection.messages.raw_images import BY_NAME
from rover_obstacle_detection.offline.inspection.calibration import (
    Calibration,
    find_calibration,
    without_path,
)
from rover_obstacle_detection.offline.inspection.findings import (
    what_is_doubtful,
    what_is_missing,
)
from rover_obstacle_detection.offline.inspection.sample import Sample, take_sample
from rover_obstacle_detection.offline.inspection.streams import (
    Stream,
    Synchronisation,
    in_order,
    read_streams,
    synchronise,
)
from rover_obstacle_detection.pairing import Pair

SAMPLED_PAIRS = 10
GRAVITY_TYPES = {'sensor_msgs/msg/Imu': 'imu', 'tf2_msgs/msg/TFMessage': 'tf'}


@dataclass(frozen=True)
class InspectionOptions:
    """What to inspect.

    Parameters
    ----------
    left_topic, right_topic : str, optional
        Image topics; every stereo camera that is found by name if both are omitted.
    calibration : CalibrationRequest
        From the bag if nothing is given.
    side_by_side : bool
        The images of `left_topic` show both views side by side.
    rectify : str
        Which images are raw, one of `messages.raw_images.RECTIFY`.
    """

    left_topic: str | None = None
    right_topic: str | None = None
    calibration: CalibrationRequest = field(default_factory=CalibrationRequest)
    side_by_side: bool = False
    rectify: str = BY_NAME


@dataclass(frozen=True)
class CameraInspection:
    """One stereo camera of a recording.

    Parameters
    ----------
    topics : StereoTopics
    left, right : Stream
    synchronisation : Synchronisation
    calibration : Calibration
    sample : Sample
    missing : tuple of str
        What keeps it from being replayed.
    warnings : tuple of str
        What makes the result doubtful.
    command : str
        Replays it.
    pairs : tuple of Pair
        Log times and stamps of all pairs.
    """

    topics: StereoTopics
    left: Stream
    right: Stream
    synchronisation: Synchronisation
    calibration: Calibration
    sample: Sample
    missing: tuple[str, ...]
    warnings: tuple[str, ...]
    command: str
    pairs: tuple[Pair, ...]


@dataclass(frozen=True)
class BagInspection:
    """A recording.

    Parameters
    ----------
    path : Path
    size_bytes : int
    length_s : float
    damage : tuple of str
    gravity : dict of str to str
        Value of ``gravity_source`` of each topic that it can use.
    cameras : tuple of CameraInspection
    missing : tuple of str
        What concerns no single camera.
    command : str
        Replays it, if there is no camera; with placeholders.
    """

    path: Path
    size_bytes: int
    length_s: float
    damage: tuple[str, ...]
    gravity: dict[str, str]
    cameras: tuple[CameraInspection, ...]
    missing: tuple[str, ...]
    command: str

    @property
    def can_be_replayed(self) -> bool:
        """Whether at least one camera lacks nothing."""
        return any(not camera.missing for camera in self.cameras)


def inspect_bag(path: Path, options: InspectionOptions) -> BagInspection:
    """Inspect a recording.

    Raises
    ------
    ObstacleDetectionError
        If it cannot be opened, or a given topic or calibration file cannot be used.
    """
    with open_bag(path) as bag:
        found, missing = _topics(bag, options)
        cameras = [replace(each, rectify=options.rectify) for each in found]
        images = {name for each in cameras for name in (each.left_image, each.right_image)}
        infos = {name for each in cameras for name in (each.left_info, each.right_info) if name}
        streams, info_streams = read_streams(bag, images, infos)
        inspected = tuple(
            _inspect_camera(
                bag,
                topics,
                streams,
                find_calibration(bag, topics, info_streams, options.calibration),
                options,
                is_only=len(cameras) == 1,
            )
            for topics in cameras
        )
        return BagInspection(
            path=path,
            size_bytes=_size_bytes(path),
            length_s=(bag.end_ns - bag.start_ns) / 1e9,
            damage=bag.notes,
            gravity={
                topic: GRAVITY_TYPES[kind]
                for topic, kind in sorted(bag.topics.items())
                if kind in GRAVITY_TYPES
            },
            cameras=inspected,
            missing=missing,
            command=_command(bag, ['--left-topic', 'LEFT_TOPIC', '--right-topic', 'RIGHT_TOPIC']),
        )


def _topics(
    bag: BagReader, options: InspectionOptions
) -> tuple[list[StereoTopics], tuple[str, ...]]:
    left, right = options.left_topic, options.right_topic
    if left or right:
        found = bag.stereo_topics(
            left_image=left, right_image=right, side_by_side=options.side_by_side
        )
        return [found], ()
    cameras = stereo_cameras(bag.topics)
    if cameras:
        return cameras, ()
    try:
        return [bag.stereo_topics()], ()
    except BagError as error:
        return [], (without_path(error, bag),)


def _inspect_camera(
    bag: BagReader,
    topics: StereoTopics,
    streams: dict[str, Stream],
    calibration: Calibration,
    options: InspectionOptions,
    *,
    is_only: bool,
) -> CameraInspection:
    left, right = streams[topics.left_image], streams[topics.right_image]
    synchronisation, pairs = synchronise(left, right)
    sample = take_sample(
        bag,
        topics,
        pairs or in_order(left, right),
        calibration,
        SAMPLED_PAIRS,
        of_one_moment=bool(pairs),
    )
    arguments = []
    if topics.is_side_by_side:
        arguments += ['--side-by-side', '--left-topic', topics.left_image]
    elif options.left_topic or options.right_topic or not is_only:
        arguments += ['--left-topic', topics.left_image, '--right-topic', topics.right_image]
    if topics.rectify != BY_NAME:
        arguments += ['--rectify', topics.rectify]
    if options.calibration.is_given:
        arguments += options.calibration.arguments()
    elif calibration.problem:
        arguments += ['--left-info', 'LEFT.yaml', '--right-info', 'RIGHT.yaml']
    if synchronisation.approximate_sync_s:
        arguments += ['--approximate-sync', f'{synchronisation.approximate_sync_s:g}']
    if sample.is_upside_down:
        arguments += ['--set', 'upside_down=true']
    return CameraInspection(
        topics,
        left,
        right,
        synchronisation,
        calibration,
        sample,
        missing=tuple(what_is_missing(left, right, synchronisation, calibration, sample)),
        warnings=tuple(what_is_doubtful(left, right, synchronisation, calibration, sample)),
        command=_command(bag, arguments),
        pairs=tuple(pairs),
    )


def _command(bag: BagReader, arguments: Sequence[str]) -> str:
    output = f'{bag_name(bag.path)}_detections'
    salvage = ['--salvage'] if bag.notes else []
    return shlex.join(
        ['rover-obstacles', 'replay', str(bag.path), '--output', output, *arguments, *salvage]
    )


def _size_bytes(path: Path) -> int:
    files = path.rglob('*') if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())
