"""Inspect a recording: what it holds, what it lacks, and how to replay it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_obstacle_detection.bags.reader import BagReader, bag_name, open_bag
from rover_obstacle_detection.bags.topics import StereoTopics, stereo_cameras
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.errors import (
    BagError,
    CameraError,
    ObstacleDetectionError,
    failure_text,
)
from rover_obstacle_detection.messages.calibration import (
    StereoCalibration,
    load_stereo_calibration,
)
from rover_obstacle_detection.messages.rectification import StereoRectification
from rover_obstacle_detection.offline.inspection.pairs import (
    GeometryMeasures,
    ImageMeasures,
    as_grey,
    measure_geometry,
    sample_images,
)
from rover_obstacle_detection.offline.inspection.streams import (
    InfoStream,
    Stream,
    Synchronisation,
    read_streams,
    synchronise,
)
from rover_obstacle_detection.pairing import Pair

SAMPLED_PAIRS = 10
GRAVITY_TYPES = {'sensor_msgs/msg/Imu': 'imu', 'tf2_msgs/msg/TFMessage': 'tf'}
# Mean of a pair's images beyond which their contrast or brightness is doubtful.
_MAX_GREY_RATIO = 1.3
_MAX_SHARPNESS_RATIO = 2.0
_MAX_SATURATED_SHARE = 0.02
_DARK_GREY = 15
_DOUBTFUL_PX = 1.0


@dataclass(frozen=True)
class InspectionOptions:
    """What to inspect.

    Parameters
    ----------
    left_topic, right_topic : str, optional
        Image topics; every stereo camera that is found by name if both are omitted.
    calibration : tuple of two Path, optional
        Calibration files of the left and the right camera; from the bag if omitted.
    """

    left_topic: str | None = None
    right_topic: str | None = None
    calibration: tuple[Path, Path] | None = None


@dataclass(frozen=True)
class Calibration:
    """The calibration of a camera.

    Parameters
    ----------
    stereo : StereoCalibration or None
        None if it is missing or invalid.
    rectification : StereoRectification or None
        For raw images.
    problem : str
        Why there is none.
    left, right : InfoStream or None
        The messages of the info topics.
    """

    stereo: StereoCalibration | None
    rectification: StereoRectification | None
    problem: str
    left: InfoStream | None
    right: InfoStream | None

    @property
    def camera(self) -> StereoCamera | None:
        """The stereo camera."""
        return self.stereo.camera if self.stereo else None


@dataclass(frozen=True)
class Sample:
    """What the sampled pairs show.

    Parameters
    ----------
    pairs : int
        Decoded.
    bad : tuple of str
        Why others cannot be decoded or do not fit the calibration.
    images : tuple of (ImageMeasures, ImageMeasures)
        Of the left and the right image.
    geometry : tuple of GeometryMeasures
        Of the pairs with enough matches.
    unjudgeable : tuple of str
        Why the detector refuses the pairs, if it refuses all of them.
    """

    pairs: int
    bad: tuple[str, ...]
    images: tuple[tuple[ImageMeasures, ImageMeasures], ...]
    geometry: tuple[GeometryMeasures, ...]
    unjudgeable: tuple[str, ...] = ()


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
    calibration = load_stereo_calibration(*options.calibration) if options.calibration else None
    with open_bag(path) as bag:
        cameras, missing = _topics(bag, options)
        images = {name for each in cameras for name in (each.left_image, each.right_image)}
        infos = {name for each in cameras for name in (each.left_info, each.right_info) if name}
        streams, info_streams = read_streams(bag, images, infos)
        inspected = tuple(
            _inspect_camera(
                bag,
                topics,
                streams,
                _calibration(bag, topics, info_streams, calibration),
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
    given = {'left_image': options.left_topic, 'right_image': options.right_topic}
    if any(given.values()):
        return [bag.stereo_topics(**given)], ()
    cameras = stereo_cameras(bag.topics)
    if cameras:
        return cameras, ()
    try:
        return [bag.stereo_topics()], ()
    except BagError as error:
        return [], (_without_path(error, bag),)


def _calibration(
    bag: BagReader,
    topics: StereoTopics,
    infos: dict[str, InfoStream],
    given: StereoCalibration | None,
) -> Calibration:
    left, right = (infos.get(name or '') for name in (topics.left_info, topics.right_info))
    try:
        stereo = given or bag.calibration(topics)
        rectification = None if topics.is_rectified else StereoRectification(stereo)
    except (BagError, CameraError) as error:
        return Calibration(None, None, _without_path(error, bag), left, right)
    return Calibration(stereo, rectification, '', left, right)


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
    sample = take_sample(bag, topics, pairs, calibration, SAMPLED_PAIRS)
    arguments = []
    if options.left_topic or options.right_topic or not is_only:
        arguments += ['--left-topic', topics.left_image, '--right-topic', topics.right_image]
    if options.calibration:
        left_info, right_info = map(str, options.calibration)
        arguments += ['--left-info', left_info, '--right-info', right_info]
    elif calibration.problem:
        arguments += ['--left-info', 'LEFT.yaml', '--right-info', 'RIGHT.yaml']
    if synchronisation.approximate_sync_s:
        arguments += ['--approximate-sync', f'{synchronisation.approximate_sync_s:g}']
    return CameraInspection(
        topics,
        left,
        right,
        synchronisation,
        calibration,
        sample,
        missing=tuple(_missing(left, right, synchronisation, calibration, sample)),
        warnings=tuple(_warnings(left, right, synchronisation, calibration, sample)),
        command=_command(bag, arguments),
        pairs=tuple(pairs),
    )


def take_sample(
    bag: BagReader,
    topics: StereoTopics,
    pairs: Sequence[Pair],
    calibration: Calibration,
    most: int,
) -> Sample:
    """Decode and measure up to `most` pairs that are spread over the recording."""
    bad: list[str] = []
    images: list[tuple[ImageMeasures, ImageMeasures]] = []
    geometry: list[GeometryMeasures] = []
    unjudgeable: list[str] = []
    for decoded in sample_images(bag, topics, pairs, most):
        try:
            if isinstance(decoded, Exception):
                raise decoded
            left, right = decoded
            grey = as_grey(left, right)
            images.append((ImageMeasures.of(grey[0]), ImageMeasures.of(grey[1])))
            if calibration.camera is None:
                continue
            if calibration.rectification:
                grey = as_grey(*calibration.rectification(*grey))
            if grey[0].shape != calibration.camera.shape:
                height, width = grey[0].shape
                raise CameraError(
                    f'the images are {width} x {height}, but the calibration is for '
                    f'{calibration.camera.width} x {calibration.camera.height}'
                )
            measured = measure_geometry(grey, calibration.camera)
            if measured is not None:
                geometry.append(measured)
            if len(unjudgeable) == len(images) - 1:
                # Until the first pair that the detector judges.
                unjudgeable += _refusal(grey, calibration.camera)
        except Exception as error:
            bad.append(failure_text(error))
    judged = len(unjudgeable) < len(images)
    return Sample(
        len(images),
        tuple(bad),
        tuple(images),
        tuple(geometry),
        () if judged else tuple(unjudgeable),
    )


def _refusal(pair: GreyPair, camera: StereoCamera) -> list[str]:
    """Why the detector cannot judge a pair; empty if it can."""
    try:
        Detector(camera).detect(*pair)
    except ObstacleDetectionError as error:
        return [failure_text(error)]
    return []


def _missing(
    left: Stream,
    right: Stream,
    synchronisation: Synchronisation,
    calibration: Calibration,
    sample: Sample,
) -> list[str]:
    missing = [
        f'{stream.topic} has no usable image{_first(stream.bad)}'
        for stream in (left, right)
        if not stream.images
    ]
    if not missing and not synchronisation.pairs:
        missing.append(
            'left and right images show different moments: smallest stamp gap '
            f'{synchronisation.smallest_gap_ms:.3f} ms: expected synchronised cameras'
        )
    if calibration.problem:
        missing.append(calibration.problem)
    if synchronisation.pairs and len(sample.bad) >= max(sample.pairs, 1):
        missing.append(f'no pair can be used: {sample.bad[0]}')
    half = len(sample.geometry) / 2
    if sum(each.swapped for each in sample.geometry) > half:
        missing.append('left and right images are swapped: exchange the topics')
    if sum(each.upside_down for each in sample.geometry) > half:
        missing.append(
            'the ground is at the top of the images: turn both by 180 degrees and exchange them'
        )
    if sample.unjudgeable and not missing:
        missing.append(f'no sampled pair can be judged: {sample.unjudgeable[0]}')
    return missing


def _warnings(
    left: Stream,
    right: Stream,
    synchronisation: Synchronisation,
    calibration: Calibration,
    sample: Sample,
) -> list[str]:
    warnings = []
    for stream in (left, right):
        if stream.images and stream.bad:
            warnings.append(f'{stream.topic}: {len(stream.bad)} bad messages{_first(stream.bad)}')
        if stream.repeats:
            warnings.append(
                f'{stream.topic}: {stream.repeats} of {stream.images} images repeat the one '
                'before, byte for byte: the camera or its driver was frozen'
            )
        if len(stream.sizes) > 1:
            warnings.append(f'{stream.topic} changes size: {", ".join(sorted(stream.sizes))}')
    lone = max(left.images, right.images) - synchronisation.pairs
    if lone and synchronisation.pairs:
        warnings.append(f'{lone} images have no partner')
    changes = sum(each.changes for each in (calibration.left, calibration.right) if each)
    if changes:
        warnings.append(f'the calibration changes {changes} times: the first one is shown')
    if sample.bad and len(sample.bad) < sample.pairs:
        warnings.append(f'{len(sample.bad)} sampled pairs cannot be used{_first(sample.bad)}')
    return [*warnings, *_doubtful_geometry(calibration, sample), *_doubtful_images(sample)]


def _doubtful_geometry(calibration: Calibration, sample: Sample) -> list[str]:
    if calibration.camera and sample.pairs and not sample.geometry and not sample.bad:
        return ['too few matches to measure the rectification']
    warnings = []
    usable = [each for each in sample.geometry if not each.swapped]
    for name, values in (
        ('the right image is off by rows', [each.rows_off_px for each in usable]),
        ('the lenses are distorted after rectification', [each.lens_bend_px for each in usable]),
    ):
        if values and np.median(values) >= _DOUBTFUL_PX:
            warnings.append(f'{name}: median {np.median(values):.1f} px: recalibrate')
    return warnings


def _doubtful_images(sample: Sample) -> list[str]:
    if not sample.images:
        return []
    warnings = []
    greys, sharpness, saturated = (
        np.median([[getattr(side, name) for side in each] for each in sample.images], axis=0)
        for name in ('median_grey', 'sharpness', 'saturated_share')
    )
    if (greys.max() + 1) / (greys.min() + 1) > _MAX_GREY_RATIO:
        darker = 'left' if greys[0] < greys[1] else 'right'
        warnings.append(
            f'the {darker} image is darker: median grey {greys[0]:.0f} and {greys[1]:.0f}: use '
            'one exposure for both'
        )
    if (sharpness.max() + 1e-4) / (sharpness.min() + 1e-4) > _MAX_SHARPNESS_RATIO:
        duller = 'left' if sharpness[0] < sharpness[1] else 'right'
        warnings.append(f'the {duller} image is less sharp: check its focus and its lens')
    for side, grey, share in zip(('left', 'right'), greys, saturated, strict=True):
        if grey < _DARK_GREY:
            warnings.append(f'the {side} image is dark: median grey {grey:.0f} of 255')
        if share > _MAX_SATURATED_SHARE:
            warnings.append(f'{share:.0%} of the {side} image is saturated: check the exposure')
    return warnings


def _first(reasons: Sequence[str]) -> str:
    return f': {reasons[0]}' if reasons else ''


def _without_path(error: ObstacleDetectionError, bag: BagReader) -> str:
    return failure_text(error).removeprefix(f'{bag.path}: ')


def _command(bag: BagReader, arguments: Sequence[str]) -> str:
    output = f'{bag_name(bag.path)}_detections'
    salvage = ['--salvage'] if bag.notes else []
    return shlex.join(
        ['rover-obstacles', 'replay', str(bag.path), '--output', output, *arguments, *salvage]
    )


def _size_bytes(path: Path) -> int:
    files = path.rglob('*') if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())
