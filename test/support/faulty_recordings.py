"""Recordings with faults, each written by a function of a folder that returns replay's arguments.

Those with a single bad moment have it in their second pair; the other pairs are good.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from hand_made import CAMERA, FIRST_STAMP_NS, stereo_images, write_stereo_bag
from recordings import stereo_messages, write_ros2

from rover_obstacle_detection.bags import decompression
from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.messages.header import make_header, stamp_ns
from rover_obstacle_detection.messages.rosbags_factory import RosbagsFactory

PAIRS = 4
BAD = 1
PERIOD_NS = 100_000_000
PLAIN = (np.full(CAMERA.shape, 90, np.uint8),) * 2
FACTORY = RosbagsFactory()

Recording = Callable[[Path], list[str]]


def _arguments(bag: Path, *options: str) -> list[str]:
    return [str(bag), *options]


def unusable(**options: Any) -> Recording:
    """Make a recording none of whose pairs can be used."""
    return lambda folder: _arguments(
        write_stereo_bag(folder / 'drive', **{'pairs': 2, 'images': [PLAIN], **options})
    )


def missing(folder: Path) -> list[str]:
    return _arguments(folder / 'drive')


def no_recording(folder: Path) -> list[str]:
    path = folder / 'drive.mcap'
    path.write_text('no recording at all')
    return _arguments(path)


def cut_short(folder: Path) -> list[str]:
    file = write_stereo_bag(folder / 'drive', pairs=2, images=[PLAIN]) / 'drive.mcap'
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    return _arguments(file)


def compressed_cut_short(folder: Path) -> list[str]:
    written = write_ros2(folder / 'drive', stereo_messages(2), 'sqlite3', 'file')
    path = next(written.glob('*.db3.zstd'))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return _arguments(path)


def zstd_bomb(folder: Path) -> list[str]:
    path = folder / 'drive.mcap.zstd'
    path.write_bytes(decompression._zstd.compress(bytes(decompression.MAX_BYTES + 1)))
    return _arguments(path)


def pipe(folder: Path) -> list[str]:
    os.mkfifo(folder / 'drive.mcap')
    return _arguments(folder / 'drive.mcap')


def images_without_partners(folder: Path) -> list[str]:
    for side, name in (('left', 'a.png'), ('right', 'b.png')):
        (folder / side).mkdir()
        (folder / side / name).touch()
    return _arguments(folder)


def other_topics(folder: Path) -> list[str]:
    with BagWriter(folder / 'drive') as bag:
        message = bag.factory.make(
            'sensor_msgs/msg/Imu', header=make_header(1, 'imu', bag.factory)
        )
        bag.add('/imu/data', 'sensor_msgs/msg/Imu', message, 1)
    return _arguments(folder / 'drive')


def alias_bomb(folder: Path) -> list[str]:
    names = 'abcdefghij'
    lines = ['a: &a [x, x, x, x, x, x, x, x, x]']
    for before, name in itertools.pairwise(names):
        lines.append(f'{name}: &{name} [{", ".join([f"*{before}"] * 9)}]')
    (folder / 'bomb.yaml').write_text('\n'.join(lines))
    return [*unusable()(folder), '--params', str(folder / 'bomb.yaml')]


def upright(folder: Path) -> list[str]:
    return _arguments(write_stereo_bag(folder / 'drive', pairs=2), '--set', 'upside_down=true')


def infos(change: Callable[[str, Any], None]) -> Recording:
    """Change the calibration of all pairs."""
    return unusable(change_info=change)


def left_info(**fields: Any) -> Recording:
    def change(side: str, info: Any) -> None:
        if side == 'left':
            for name, value in fields.items():
                setattr(info, name, value)

    return infos(change)


def projection(**numbers: float) -> Recording:
    """Replace numbers of P of both cameras: ``p3=...`` only of the right one."""

    def change(side: str, info: Any) -> None:
        for name, value in numbers.items():
            if name != 'p3' or side == 'right':
                info.p[int(name[1:])] = value

    return infos(change)


def bad_image(spoil: Callable[[Any], Any], side: str = 'left') -> Recording:
    """Spoil one image."""

    def change(index: int, which: str, message: Any) -> Any:
        return spoil(message) if (index, which) == (BAD, side) else None

    return lambda folder: _arguments(
        write_stereo_bag(folder / 'drive', pairs=PAIRS, change_image=change)
    )


def bad_compressed_image(spoil: Callable[[bytearray], bytearray], extension: str) -> Recording:
    """Spoil one image of a recording of compressed images."""

    def change(index: int, side: str, message: Any) -> Any:
        grey = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width)
        data = bytearray(cv2.imencode(extension, grey)[1])
        if (index, side) == (BAD, 'left'):
            data = spoil(data)
        return FACTORY.make(
            'sensor_msgs/msg/CompressedImage',
            header=message.header,
            format=extension[1:],
            data=np.frombuffer(bytes(data), np.uint8),
        )

    return lambda folder: _arguments(
        write_stereo_bag(folder / 'drive', pairs=PAIRS, change_image=change)
    )


def bad_pair(change: Callable[[Any, Any], tuple[Any, Any]]) -> Recording:
    """Spoil both images of a pair."""

    def make(folder: Path) -> list[str]:
        images = [stereo_images() for _ in range(PAIRS)]
        images[BAD] = change(*images[BAD])
        return _arguments(write_stereo_bag(folder / 'drive', pairs=PAIRS, images=images))

    return make


def bad_info(**fields: Any) -> Recording:
    """Change the calibration of one moment."""

    def change(side: str, info: Any) -> None:
        if stamp_ns(info.header) == FIRST_STAMP_NS + BAD * PERIOD_NS:
            for name, value in fields.items():
                setattr(info, name, value)

    return lambda folder: _arguments(
        write_stereo_bag(folder / 'drive', pairs=PAIRS, change_info=change)
    )


def wrong_byte_order(folder: Path) -> list[str]:
    images = [tuple(image.astype(np.uint16) * 13 for image in stereo_images())]

    def change(index: int, side: str, message: Any) -> None:
        if (index, side) == (BAD, 'left'):
            message.is_bigendian = 1 - message.is_bigendian

    return _arguments(
        write_stereo_bag(
            folder / 'drive', pairs=PAIRS, images=images, encoding='mono16', change_image=change
        )
    )


def no_stamp(message: Any) -> None:
    message.header = make_header(0, 'left_optical', FACTORY)


def huge_jpeg(data: bytearray) -> bytearray:
    frame = data.index(b'\xff\xc0')
    data[frame + 5 : frame + 9] = b'\x3a\x98\xfd\xe8'  # 15000 x 65000
    return data


def endless_png_chunk(data: bytearray) -> bytearray:
    chunk = data.index(b'IDAT') - 4
    data[chunk : chunk + 4] = b'\xff\xff\xff\xff'
    return data


def half(data: bytearray) -> bytearray:
    return data[: len(data) // 2]


def swapped(left: Any, right: Any) -> tuple[Any, Any]:
    return right, left
