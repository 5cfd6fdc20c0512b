"""Faults of recordings; the tests of `replay` and docs/reliability.md follow it."""

from __future__ import annotations

import math
from typing import Any

import degrade
import faulty_recordings as recorded
import numpy as np
from fault_row import BAD_FRAME, REPLAY, Row
from spoilt_images import set_field


def bad_frame(fault: str, says: str, inject: Any) -> Row:
    """A pair of a recording that cannot be used."""
    return Row(REPLAY, fault, says, inject, status=BAD_FRAME)


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
        'a compressed database cut short',
        '…: cannot be read; is it cut short or damaged? (Compressed file ended before …)',
        recorded.compressed_cut_short,
    ),
    Row(
        REPLAY,
        'a compressed file that would fill the disk',
        '…: the file has more than N bytes after decompression: expected at most N times its '
        'size, and half of the free disk space',
        recorded.zstd_bomb,
    ),
    Row(
        REPLAY,
        'a pipe instead of a file',
        '…: is no file, but a pipe or a device',
        recorded.pipe,
    ),
    Row(
        REPLAY,
        'a folder of images without partners',
        '… and …: no image is on both sides, as by a.png and b.png: expected equal names, apart '
        'from left and right',
        recorded.images_without_partners,
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
        '`upside_down` for a camera that is mounted upright',
        '…: no usable pair: … the ground is at the bottom of the images, but upside_down is true: '
        'is the camera mounted upright? Then set upside_down to false',
        recorded.upright,
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
