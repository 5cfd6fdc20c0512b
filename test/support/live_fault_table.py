"""Faults of a start and of a running node; the live tests and docs/reliability.md follow it."""

from __future__ import annotations

import math
from typing import Any

import faulty_rover as faults
import numpy as np
from fault_row import LIVE, START, Row
from spoilt_images import no_stamp, set_field, shrink, truncate

OTHER_FILE = 'other.yaml'
"""Has parameters of another node only; `OTHER_PARAMETERS` is its text."""
OTHER_PARAMETERS = 'obstacle_detector: {ros__parameters: {max_step: 0.2}}\n'


def bad_pair(fault: str, says: str, inject: Any) -> Row:
    """A pair that cannot be judged."""
    return Row(LIVE, fault, says, inject, status='detection', logged='WARN')


def bad_info(fault: str, says: str, inject: Any) -> Row:
    """A calibration that cannot be used."""
    return Row(LIVE, fault, says, inject, status='calibration', logged='WARN')


LEFT, RIGHT = '/stereo/left/image_rect', '/stereo/right/image_rect'
LEFT_INFO, RIGHT_INFO = '/stereo/left/camera_info', '/stereo/right/camera_info'

# `inject`: arguments of run.
START_ROWS = (
    Row(
        START,
        'a parameter out of range',
        'max_step is 9.5: expected 0.01 to 2',
        ('--ros-args', '-p', 'max_step:=9.5'),
    ),
    Row(
        START,
        'a parameter of the wrong type',
        "max_step is 'high': expected a number",
        ('--ros-args', '-p', 'max_step:=high'),
    ),
    Row(
        START,
        'parameters that conflict',
        'max_range is 0.2: expected more than min_range, 0.3',
        ('--ros-args', '-p', 'max_range:=0.2'),
    ),
    Row(
        START,
        'a misspelt parameter',
        'max_stepp is not a parameter: did you mean max_step?',
        ('--ros-args', '-p', 'max_stepp:=0.2'),
    ),
    Row(
        START,
        'no such parameter file',
        'missing.yaml: no such parameter file',
        ('--params', 'missing.yaml'),
    ),
    Row(
        START,
        'a parameter file for a node in another namespace',
        f'{OTHER_FILE}: only has parameters of /obstacle_detector: expected /** or '
        '/stereo/obstacle_detector',
        ('--namespace', 'stereo', '--params', OTHER_FILE),
    ),
    Row(
        START,
        'an unknown camera driver',
        "camera is 'realsence': expected one of zed, zed4, realsense, oak, oak2, multisense, "
        'gazebo, raw; did you mean realsense?',
        ('--camera', 'realsence'),
    ),
    Row(
        START,
        'a namespace that ROS does not allow',
        "namespace is 'rover 1': expected letters, digits, _ and / as in front/stereo",
        ('--namespace', 'rover 1'),
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
    bad_pair(
        '`upside_down` for a camera that is mounted upright',
        f'{LEFT}, {RIGHT}: the ground is at the bottom of the images, but upside_down is true: is '
        'the camera mounted upright? Then set upside_down to false',
        faults.upright,
    ),
    # Load
    Row(
        LIVE,
        'results that come late',
        'results come N s after their images (95th percentile of the last N s): expected at most '
        'max_image_age, N s; set speed to fast, or lower working_scale',
        faults.slow,
        level='WARN',
        status='detection',
    ),
    Row(
        LIVE,
        'more pairs than the computer can judge',
        "N of N pairs per second are judged: lower the camera's rate, set speed to fast, or lower "
        'working_scale',
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
        faults.raw_images(),
    ),
    bad_info(
        'raw images whose K is in metres',
        f'{LEFT} and {RIGHT} are raw images and cannot be rectified: {LEFT_INFO}, {RIGHT_INFO}: '
        'with K (0.001, …) … the rectified image shows only N% of the raw one: expected at least '
        '1%; …',
        faults.raw_images(k=np.array([0.001, 0, 0, 0, 0.001, 0, 0, 0, 1]), r=np.eye(3).ravel()),
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
