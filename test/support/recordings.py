"""Small recordings for the tests, in every format that is read."""

from __future__ import annotations

import sqlite3
from typing import NamedTuple

import cv2
import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.image import encode_image
from rover_obstacle_detection.messages.rosbags_factory import (
    RosbagsFactory,
    ros1_typestore,
    ros2_typestore,
)

WIDTH, HEIGHT = 32, 24
START_NS = 1_700_000_000_000_000_000
FRAME_NS = 100_000_000

IMAGE = 'sensor_msgs/msg/Image'
COMPRESSED = 'sensor_msgs/msg/CompressedImage'
INFO = 'sensor_msgs/msg/CameraInfo'
TEXT = 'std_msgs/msg/String'

ROS2 = RosbagsFactory(ros2_typestore())
ROS1 = RosbagsFactory(ros1_typestore())


class Recorded(NamedTuple):
    """One message of a recording."""

    topic: str
    type_name: str
    message: object
    time_ns: int


def pixels(number, side='left'):
    """Build an image that no other frame or side has."""
    seed = 2 * number + (side == 'right')
    return np.random.default_rng(seed).integers(0, 255, (HEIGHT, WIDTH), np.uint8)


def image(array, stamp_ns, factory=ROS2, encoding='mono8', frame_id='left_optical'):
    return encode_image(array, encoding, make_header(stamp_ns, frame_id, factory), factory)


def compressed(array, stamp_ns, factory=ROS2, extension='.png'):
    return factory.make(
        COMPRESSED,
        header=make_header(stamp_ns, 'left_optical', factory),
        format=f'mono8; {extension[1:]} compressed ',
        data=cv2.imencode(extension, array)[1].reshape(-1),
    )


def info(side, stamp_ns, factory=ROS2, *, focal=40.0, baseline=0.1, size=(WIDTH, HEIGHT), d=()):
    shift = -focal * baseline if side == 'right' else 0.0
    matrices = {
        'd': np.asarray(d, np.float64),
        'k': np.array([focal, 0, 15.5, 0, focal, 11.5, 0, 0, 1]),
        'r': np.identity(3).reshape(-1),
        'p': np.array([focal, 0, 15.5, shift, 0, focal, 11.5, 0, 0, 0, 1, 0]),
    }
    if factory is ROS1:
        matrices = {name.upper(): matrix for name, matrix in matrices.items()}
    return factory.make(
        INFO,
        header=make_header(stamp_ns, 'left_optical', factory),
        width=size[0],
        height=size[1],
        distortion_model='plumb_bob',
        **matrices,
    )


def stereo_messages(
    frames=3,
    *,
    factory=ROS2,
    namespace='/stereo',
    name='image_rect',
    is_compressed=False,
    with_info=True,
    gap_ns=0,
    **calibration,
):
    """List the messages of a stereo camera; the right image's stamps are `gap_ns` later."""
    messages = []
    for number in range(frames):
        for side in ('left', 'right'):
            stamp = START_NS + number * FRAME_NS + (gap_ns if side == 'right' else 0)
            make, type_name = (compressed, COMPRESSED) if is_compressed else (image, IMAGE)
            topic = f'{namespace}/{side}/{name}' + ('/compressed' if is_compressed else '')
            shown = make(pixels(number, side), stamp, factory)
            messages.append(Recorded(topic, type_name, shown, stamp))
            if with_info:
                about = info(side, stamp, factory, **calibration)
                messages.append(Recorded(f'{namespace}/{side}/camera_info', INFO, about, stamp))
    return messages


def text_messages(count=3):
    return [
        Recorded('/log', TEXT, ROS2.make(TEXT, data='x' * 50), START_NS + number * FRAME_NS)
        for number in range(count)
    ]


def write_ros2(path, messages, storage='mcap', compression=None):
    """Write a rosbag2 folder; return it."""
    plugin = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}[storage]
    writer = Writer2(path, version=9, storage_plugin=plugin)
    if compression:
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        _write(writer, messages, ros2_typestore(), 'serialize_cdr')
    return path


def write_ros1(path, messages, compression=None):
    """Write a rosbag1 file; return it."""
    writer = Writer1(path)
    if compression:
        writer.set_compression(compression)
    with writer:
        _write(writer, messages, ros1_typestore(), 'serialize_ros1')
    return path


def write_mcap(
    path,
    messages,
    *,
    with_types=True,
    chunk_size=1 << 20,
    profile='ros2',
    compression=CompressionType.ZSTD,
):
    """Write a bare mcap file with the mcap package; return it."""
    typestore = ros2_typestore()
    with path.open('wb') as file:
        writer = McapWriter(file, chunk_size=chunk_size, compression=compression)
        writer.start(profile)
        channels = {}
        for topic, type_name, message, time_ns in messages:
            if topic not in channels:
                definition = typestore.generate_msgdef(type_name, ros_version=2)[0]
                schema = writer.register_schema(
                    type_name,
                    'ros2msg' if with_types else '',
                    definition.encode() if with_types else b'',
                )
                channels[topic] = writer.register_channel(topic, 'cdr', schema)
            writer.add_message(
                channels[topic],
                time_ns,
                bytes(typestore.serialize_cdr(message, type_name)),
                time_ns,
            )
        writer.finish()
    return path


def forget_types(folder):
    """Take the type definitions out of a sqlite3 recording, as those before ROS 2 Iron are."""
    with sqlite3.connect(next(folder.glob('*.db3'))) as database:
        database.execute('DELETE FROM message_definitions')
    database.close()
    return folder


def _write(writer, messages, typestore, serialize):
    connections = {}
    for topic, type_name, message, time_ns in messages:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, type_name, typestore=typestore)
        data = getattr(typestore, serialize)(message, type_name)
        writer.write(connections[topic], time_ns, data)


WRITERS = {
    'mcap': lambda path, messages: write_ros2(path, messages),
    'mcap zstd': lambda path, messages: write_ros2(path, messages, compression='storage'),
    'sqlite3': lambda path, messages: write_ros2(path, messages, 'sqlite3'),
    'sqlite3 zstd file': lambda path, messages: write_ros2(path, messages, 'sqlite3', 'file'),
    'sqlite3 zstd messages': lambda path, messages: write_ros2(
        path, messages, 'sqlite3', 'message'
    ),
    'mcap zstd file': lambda path, messages: write_ros2(path, messages, compression='file'),
    'sqlite3 without types': lambda path, messages: forget_types(
        write_ros2(path, messages, 'sqlite3')
    ),
    'mcap file': lambda path, messages: write_mcap(path.with_suffix('.mcap'), messages),
    'mcap file without types': lambda path, messages: write_mcap(
        path.with_suffix('.mcap'), messages, with_types=False
    ),
    'mcap file of no profile': lambda path, messages: write_mcap(
        path.with_suffix('.mcap'), messages, profile=''
    ),
    'rosbag1': lambda path, messages: write_ros1(path.with_suffix('.bag'), messages),
}
"""Every format, each a function of a path and messages that returns what to open."""
