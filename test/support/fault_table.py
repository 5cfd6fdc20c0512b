"""What goes wrong and what the software says; the live tests and docs/reliability.md follow it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import degrade
import faulty_recordings as recorded
import faulty_rover as faults
import numpy as np
from spoilt_images import no_stamp, set_field, shrink, truncate

# Start: arguments of the node. Live: an injection of faulty_rover.
START, LIVE, REPLAY = 'start', 'live', 'replay'
BAD_FRAME = 'bad frame'
OTHER_FILE = 'other.yaml'
"""Has parameters of another node only; `OTHER_PARAMETERS` is its text."""
OTHER_PARAMETERS = 'obstacle_detector: {ros__parameters: {max_step: 0.2}}\n'


@dataclass(frozen=True)
class Row:
    """One fault.

    Parameters
    ----------
    kind : str
        `START`, `LIVE` or `REPLAY`.
    fault : str
        What goes wrong, for users.
    says : str
        What the user reads: N stands for a number, … for anything.
    inject : callable or tuple
        How a test brings it about; depends on the kind.
    level : str
        On /diagnostics: WARN or ERROR.
    status : str
        The status on /diagnostics, or `BAD_FRAME`; empty if the program ends with exit status 1.
    logged : str
        The severity in the log, if it is not the level.
    """

    kind: str
    fault: str
    says: str
    inject: Callable[..., Any] | tuple[str, ...]
    level: str = 'ERROR'
    status: str = ''
    logged: str = ''

    def __post_init__(self) -> None:
        object.__setattr__(self, 'logged', self.logged or self.level)

    @property
    def pattern(self) -> str:
        """`says` as a regular expression."""
        pattern = re.escape(self.says).replace('…', '.*')
        return re.sub(r'\bN\b', r'-?\\d+(\\.\\d+)?', pattern)

    @property
    def effect(self) -> str:
        """Level and status for users."""
        if not self.status:
            return 'exit status 1'
        return f'{self.level}, {self.status}' if self.kind == LIVE else self.status


def bad_pair(fault: str, says: str, inject: Any) -> Row:
    """A pair that cannot be judged."""
    return Row(LIVE, fault, says, inject, status='detection', logged='WARN')


def bad_info(fault: str, says: str, inject: Any) -> Row:
    """A calibration that cannot be used."""
    return Row(LIVE, fault, says, inject, status='calibration', logged='WARN')


def bad_frame(fault: str, says: str, inject: Any) -> Row:
    """A pair of a recording that cannot be used."""
    return Row(REPLAY, fault, says, inject, status=BAD_FRAME)


LEFT, RIGHT = '/stereo/left/image_rect', '/stereo/right/image_rect'
LEFT_INFO, RIGHT_INFO = '/stereo/left/camera_info', '/stereo/right/camera_info'

START_ROWS = (
    Row(
        START,
        'a parameter out of range',
        'max_step is 9.5: expected 0.01 to 2',
        ('-p', 'max_step:=9.5'),
    ),
    Row(
        START,
        'a parameter of the wrong type',
        "max_step is 'high': expected a number",
        ('-p', 'max_step:=high'),
    ),
    Row(
        START,
        'parameters that conflict',
        'max_range is 0.2: expected more than min_range, 0.3',
        ('-p', 'max_range:=0.2'),
    ),
    Row(
        START,
        'a misspelt parameter',
        'max_stepp is not a parameter: did you mean max_step?',
        ('-p', 'max_stepp:=0.2'),
    ),
    Row(
        START,
        'no such parameter file',
        'missing.yaml: no such parameter file',
        ('--params-file', 'missing.yaml'),
    ),
    Row(
        START,
        'a parameter file for a node in another namespace',
        f'{OTHER_FILE}: only has parameters of /obstacle_detector: expected /** or '
        '/stereo/obstacle_detector',
        ('-r', '__ns:=/stereo', '--params-file', OTHER_FILE),
    ),
)

LIVE_ROWS = (
    # Connections
    Row(
        LIVE,
        'two nodes of the same name',
        'N nodes are called /stereo/obstacle_detector: expected 1',
        faults.second_node,
        status='connections',
    ),
    Row(
        LIVE,
        'two publishers on an input topic',
        f'{LEFT_INFO}: N publishers (/test and /test): expected 1',
        faults.second_publisher,
        status='connections',
    ),
    Row(
        LIVE,
        'a subscriber that asks for latched messages',
        '/stereo/obstacle_mask: /test gets nothing: incompatible durability (volatile publisher '
        'and transient local subscription)',
        faults.latched_subscriber,
        level='WARN',
        status='connections',
    ),
    # Images that do not arrive, or do not match
    Row(
        LIVE,
        'no images',
        f'no images on {LEFT} (published by /test) and {RIGHT} (published by /test) for N s',
        faults.silent,
        status='stereo input',
    ),
    Row(
        LIVE,
        'no images of one camera',
        f'no images on {RIGHT} (no publisher) for N s',
        faults.one_camera,
        status='stereo input',
    ),
    Row(
        LIVE,
        'images lost on the way',
        'N% of the images of the last N s were lost on the way (N of N): give the camera driver '
        'the Fast DDS profile',
        faults.lost,
        level='WARN',
        status='stereo input',
    ),
    Row(
        LIVE,
        'stamps of one exposure that differ',
        'N left, N right, 0 pairs, smallest gap 20.0 ms; try approximate_sync',
        faults.unequal_stamps(later_ms=20, spacing_s=0),
        status='stereo input',
        logged='WARN',
    ),
    Row(
        LIVE,
        'cameras that are not synchronised',
        'N left, N right, 0 pairs, smallest gap 300.0 ms: the images show different moments; '
        'synchronise the cameras',
        faults.unequal_stamps(later_ms=300, spacing_s=1),
        status='stereo input',
        logged='WARN',
    ),
    Row(
        LIVE,
        '`approximate_sync` pairs images of different moments',
        'the stamps of left and right differ by up to 700 ms: moments differ; synchronise the '
        'cameras',
        faults.approximate_sync_without_limit,
        level='WARN',
        status='stereo input',
    ),
    # Images that cannot be trusted
    Row(
        LIVE,
        'a frozen camera',
        'left image has not changed for N frames (N s): the camera or its driver is frozen',
        faults.frozen,
        status='stereo input',
    ),
    Row(
        LIVE,
        'a camera that repeats its stamp',
        'header.stamp of both images has not changed for N pairs: expected the time of exposure',
        faults.repeated_stamp,
        status='stereo input',
    ),
    Row(
        LIVE,
        'images that arrive late, or clocks that differ',
        'stamps are N s behind the clock of this node: images arrive late, or the clocks differ',
        faults.late,
        status='stereo input',
    ),
    bad_pair(
        'an image without stamp',
        f'{LEFT}: header.stamp is zero: expected the time of exposure',
        faults.spoilt('left', no_stamp),
    ),
    bad_pair(
        'an image with a wrong step',
        f'{LEFT}: step is 7: expected …',
        faults.spoilt('left', set_field('step', 7)),
    ),
    bad_pair(
        'an unknown encoding',
        f"{RIGHT}: encoding is 'yuv9': expected …",
        faults.spoilt('right', set_field('encoding', 'yuv9')),
    ),
    bad_pair(
        'a truncated image',
        f'{RIGHT}: data has N bytes: expected …',
        faults.spoilt('right', truncate),
    ),
    bad_pair(
        'images of different sizes',
        f'{LEFT}: width x height is 160 x 120: expected 320 x 240, as on {RIGHT}',
        faults.spoilt('left', shrink),
    ),
    bad_pair(
        'a covered lens',
        f'{LEFT}, {RIGHT}: neither image shows any texture: check for a covered or fogged lens',
        faults.covered,
    ),
    bad_pair(
        'left and right swapped',
        f'{LEFT}, {RIGHT}: disparities are negative: expected the left image from {LEFT}; are '
        'left and right swapped?',
        faults.swapped,
    ),
    bad_pair(
        'a camera mounted upside down',
        f'{LEFT}, {RIGHT}: the ground is at the top of the images: is the camera mounted upside '
        'down? Then set upside_down to true',
        faults.upside_down,
    ),
    # Load
    Row(
        LIVE,
        'results that come late',
        'results come N s after their images (95th percentile of the last N s): expected at most '
        'max_image_age, N s; lower working_scale',
        faults.slow,
        level='WARN',
        status='detection',
    ),
    Row(
        LIVE,
        'more pairs than the computer can judge',
        "N of N pairs per second are judged: lower the camera's rate or working_scale",
        faults.flood,
        level='WARN',
        status='detection',
    ),
    # Calibration
    bad_info(
        'no `camera_info`',
        f'no calibration: nothing received on {LEFT_INFO} and {RIGHT_INFO} yet',
        faults.no_info,
    ),
    bad_info(
        '`camera_info` with a zero P',
        f'{LEFT_INFO}, {RIGHT_INFO}: … P[0] (fx) is 0.0',
        faults.bad_info(p=np.zeros(12)),
    ),
    bad_info(
        '`camera_info` with NaN',
        f'{LEFT_INFO}, {RIGHT_INFO}: … not finite',
        faults.bad_info(p=np.full(12, math.nan)),
    ),
    bad_info(
        '`camera_info` without size',
        f'{LEFT_INFO}, {RIGHT_INFO}: … size is 0 x 240',
        faults.bad_info(width=0),
    ),
    bad_info(
        '`camera_info` of two different cameras',
        f'{LEFT_INFO}, {RIGHT_INFO}: … 640 x 240',
        faults.bad_info(width=640),
    ),
    bad_info(
        'raw images whose `camera_info` has only P',
        f'{LEFT} and {RIGHT} are raw images and cannot be rectified: {LEFT_INFO}, {RIGHT_INFO}: K '
        'is (0.0, …): expected focal lengths above 0; if they are rectified, set rectify to never',
        faults.uncalibrated_raw_images,
    ),
    bad_pair(
        '`camera_info` of another size than the images',
        f'{LEFT}: width x height is 320 x 240: expected 200 x 240, as in camera_info',
        faults.other_camera,
    ),
    bad_pair(
        'images too small to match',
        f'{LEFT}, {RIGHT}: images are 8 x 8 pixels: expected at least 16 x 16',
        faults.tiny_camera,
    ),
    # Gravity
    Row(
        LIVE,
        '`gravity_source` `imu` without messages',
        '/stereo/imu: no usable message within N ms of the image; gravity is estimated from the '
        'visible ground',
        faults.no_imu,
        level='WARN',
        status='detection',
    ),
)

IMAGE, OTHER_IMAGE = '/cam/left/image_rect', '/cam/right/image_rect'

REPLAY_ROWS = (
    # Nothing can be used
    Row(REPLAY, 'no such recording', '…: no such recording', recorded.missing),
    Row(
        REPLAY,
        'a file that is no recording',
        '…: cannot be read; is it cut short or damaged?',
        recorded.no_recording,
    ),
    Row(
        REPLAY,
        'a recording cut short, as by a power loss',
        '…: cut short or damaged …: give --salvage to replay these',
        recorded.cut_short,
    ),
    Row(
        REPLAY,
        'no stereo camera',
        '…: no stereo topics: the recording has /imu/data (sensor_msgs/msg/Imu): expected …',
        recorded.other_topics,
    ),
    Row(
        REPLAY,
        'only one camera',
        f'…: only left images: {IMAGE}: expected …',
        recorded.unusable(sides=('left',)),
    ),
    Row(
        REPLAY,
        'no calibration',
        f'…: no calibration for {IMAGE} (no camera_info topic): expected …',
        recorded.unusable(infos=False),
    ),
    Row(
        REPLAY,
        'left and right calibration swapped',
        'P[3] is 20.0, so the baseline is N m: expected P[3] = -fx * baseline, below zero (are '
        'left and right swapped?)',
        recorded.projection(p3=20.0),
    ),
    Row(
        REPLAY,
        'a baseline in centimetres',
        'the baseline is N m: expected 0.001 to 5 m; is it in another unit?',
        recorded.projection(p3=-3326.0),
    ),
    Row(
        REPLAY,
        'a focal length of no camera',
        'fx is 1e-30 pixels and width 320, a field of view of 180 degrees: expected 0.5 to 170',
        recorded.projection(p0=1e-30, p5=1e-30, p3=-1e-31),
    ),
    Row(
        REPLAY,
        'a calibration of another size',
        f'{IMAGE} and {OTHER_IMAGE} are 320 x 240, but the calibration … is for 320 x 120',
        recorded.infos(lambda side, info: setattr(info, 'height', 120)),
    ),
    Row(
        REPLAY,
        'right images of another size',
        f'{OTHER_IMAGE} is 320 x 200, {IMAGE} is 320 x 240: expected the same size',
        recorded.unusable(images=[(recorded.PLAIN[0], recorded.PLAIN[1][:-40])]),
    ),
    Row(
        REPLAY,
        'cameras that are not synchronised',
        '…: no pair: N left images …, N right …, smallest stamp gap N ms: the images show '
        'different moments: expected synchronised cameras',
        recorded.unusable(right_delay_ns=45_000_000),
    ),
    Row(
        REPLAY,
        'a parameter file that unfolds to gigabytes',
        '…: is not valid YAML: anchors and aliases are not supported on line 1',
        recorded.alias_bomb,
    ),
    # One pair cannot be used
    bad_frame(
        'a truncated image',
        f'{IMAGE}: data has N bytes: expected height x step = …',
        recorded.bad_image(lambda image: setattr(image, 'data', image.data[:1000])),
    ),
    bad_frame(
        'an unknown encoding',
        f"{IMAGE}: encoding is 'yuv9': expected one of …",
        recorded.bad_image(set_field('encoding', 'yuv9')),
    ),
    bad_frame(
        'an image with a wrong step',
        f'{IMAGE}: step is 100: expected at least …',
        recorded.bad_image(set_field('step', 100)),
    ),
    bad_frame(
        'an image without stamp',
        f'{IMAGE}: header.stamp is 0 s: expected more than 0',
        recorded.bad_image(recorded.no_stamp),
    ),
    bad_frame(
        'a wrong byte order',
        f'{IMAGE}: is_bigendian is N, but only in the other byte order do the pixels show a '
        'picture: expected N',
        recorded.wrong_byte_order,
    ),
    bad_frame(
        'a damaged JPEG',
        f'{IMAGE}: data is a JPEG file of N bytes cut short',
        recorded.bad_compressed_image(recorded.half, '.jpg'),
    ),
    bad_frame(
        'a JPEG that claims to be huge',
        f'{IMAGE}: data is an image of 65000 x 15000 pixels: expected at most N pixels',
        recorded.bad_compressed_image(recorded.huge_jpeg, '.jpg'),
    ),
    bad_frame(
        'a PNG that claims to be huge',
        f"{IMAGE}: data cannot be decoded …: PNG chunk b'IDAT' has a length of N bytes: file too "
        'short',
        recorded.bad_compressed_image(recorded.endless_png_chunk, '.png'),
    ),
    bad_frame(
        'a camera without light',
        f'{IMAGE}, {OTHER_IMAGE}: neither image shows any texture: it is black, check the lens '
        'cap, the light and the exposure',
        recorded.bad_pair(degrade.black),
    ),
    bad_frame(
        'left and right swapped',
        f'{IMAGE}, {OTHER_IMAGE}: disparities are negative: expected the left image from {IMAGE}; '
        'are left and right swapped?',
        recorded.bad_pair(recorded.swapped),
    ),
    bad_frame(
        'a camera mounted upside down',
        f'{IMAGE}, {OTHER_IMAGE}: the ground is at the top of the images: is the camera mounted '
        'upside down? Then set upside_down to true',
        recorded.bad_pair(degrade.upside_down),
    ),
    bad_frame(
        '`camera_info` with NaN',
        '… P has numbers that are not finite',
        recorded.bad_info(p=np.full(12, math.nan)),
    ),
    bad_frame(
        '`camera_info` of another size',
        f'{IMAGE} and {OTHER_IMAGE} are 320 x 240, but the calibration … is for 320 x 120',
        recorded.bad_info(height=120),
    ),
)

ROWS = (*START_ROWS, *LIVE_ROWS, *REPLAY_ROWS)
