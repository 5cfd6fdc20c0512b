"""What reads bytes from outside, each as a function of bytes that may only raise known errors."""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
from recordings import ROS1, ROS2, stereo_messages, write_mcap, write_ros1, write_ros2

from rover_obstacle_detection.bags.decompression import _zstd
from rover_obstacle_detection.bags.reader import open_bag
from rover_obstacle_detection.bags.stereo import read_pairs
from rover_obstacle_detection.calibration_files.load import load_cameras
from rover_obstacle_detection.cli.main import make_parser
from rover_obstacle_detection.errors import ObstacleDetectionError
from rover_obstacle_detection.messages.calibration import StereoCalibration, load_camera_info
from rover_obstacle_detection.messages.encodings import IMAGE_ENCODINGS
from rover_obstacle_detection.messages.image import decode_camera_image, decode_compressed_image
from rover_obstacle_detection.messages.rectification import StereoRectification
from rover_obstacle_detection.parameter_file import load_config
from rover_obstacle_detection.rover_mask import RoverMask

IMAGE_TYPE = 'sensor_msgs/msg/Image'
# In memory, because each input is written to a file.
FOLDER = Path('/dev/shm') if Path('/dev/shm').is_dir() else Path(tempfile.gettempdir())
MAX_PIXELS = 1 << 20


def _file(data: bytes, suffix: str, read: Callable[[Path], object]) -> None:
    with tempfile.NamedTemporaryFile(suffix=suffix, dir=FOLDER) as file:
        file.write(data)
        file.flush()
        read(Path(file.name))


def image(data: bytes) -> None:
    """Read the fields of an Image from the first bytes, and its data from the rest."""
    fields = [*data[:8], *bytes(8)]
    names = list(IMAGE_ENCODINGS)
    message = SimpleNamespace(
        height=fields[0] - 5,
        width=fields[1] - 5,
        step=fields[2] * (fields[3] % 4),
        encoding=names[fields[4] % (len(names) + 1) - 1] if fields[5] else 'mono9',
        is_bigendian=fields[6],
        data=np.frombuffer(data[8:], np.uint8),
    )
    decode_camera_image(message, '/left')


def compressed(data: bytes) -> None:
    message = SimpleNamespace(format='png', data=np.frombuffer(data, np.uint8))
    decode_compressed_image(message, '/left', MAX_PIXELS)


def image_message(data: bytes) -> None:
    """Deserialise an Image as a bag does."""
    try:
        message = ROS2.typestore.deserialize_cdr(data, IMAGE_TYPE)
    except Exception:  # a bag reports it as a message that is damaged
        return
    decode_camera_image(message, '/left')


def _bag(suffix: str) -> Callable[[bytes], None]:
    def read(path: Path) -> None:
        with open_bag(path) as bag:
            for _ in bag.messages(list(bag.topics)):
                pass
            for _ in read_pairs(bag, bag.stereo_topics()):
                pass

    return lambda data: _file(data, suffix, read)


def calibration(data: bytes) -> None:
    _file(data, '.yaml', load_camera_info)


def cameras(data: bytes) -> None:
    """Read the calibration of both cameras, in any of the formats."""

    def read(path: Path) -> None:
        left, right = load_cameras((path,), lambda: (640, 480), colour=False)
        StereoRectification(StereoCalibration(left, right, path.name))

    _file(data, '.yaml', read)


def parameters(data: bytes) -> None:
    _file(data, '.yaml', load_config)


def polygon(data: bytes) -> None:
    RoverMask.load(polygon=data.decode(errors='replace'))


def arguments(data: bytes) -> None:
    """Parse a command line, its arguments separated by zero bytes."""
    words = [word.decode(errors='surrogateescape') for word in data.split(b'\0')]
    with (
        contextlib.redirect_stderr(io.StringIO()),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.suppress(SystemExit),
    ):
        make_parser().parse_args(words)


TARGETS: dict[str, Callable[[bytes], None]] = {
    'image': image,
    'compressed': compressed,
    'image_message': image_message,
    'mcap': _bag('.mcap'),
    'zstd': _bag('.mcap.zstd'),
    'sqlite3': _bag('.db3'),
    'rosbag1': _bag('.bag'),
    'calibration': calibration,
    'cameras': cameras,
    'parameters': parameters,
    'polygon': polygon,
    'arguments': arguments,
}


def run(target: str, data: bytes) -> bool:
    """Give data to a target; return whether it was accepted rather than refused."""
    try:
        TARGETS[target](data)
    except ObstacleDetectionError as error:
        message = str(error)
    else:
        return True
    assert len(message.splitlines()) == 1, message
    return False


def seeds(target: str, folder: Path) -> list[bytes]:
    """Return valid inputs to start from; `folder` is for temporary files."""
    grey = np.random.default_rng(1).integers(0, 255, (24, 32), np.uint8)
    config = Path(__file__).parents[2] / 'config' / 'obstacle_detector.yaml'
    messages = stereo_messages(2)
    made: dict[str, Callable[[], list[bytes]]] = {
        'image': lambda: [bytes([10, 10, 5, 1, 1, 1, 0, 0]) + bytes(25)],
        'compressed': lambda: [
            bytes(cv2.imencode(extension, grey)[1])
            for extension in ('.png', '.jpg', '.pgm', '.bmp', '.tiff')
        ],
        'image_message': lambda: [
            bytes(ROS2.typestore.serialize_cdr(messages[0].message, IMAGE_TYPE))
        ],
        'mcap': lambda: [
            write_mcap(folder / 'one.mcap', messages).read_bytes(),
            _only(write_ros2(folder / 'zstd', messages, compression='storage'), '*.mcap'),
        ],
        'zstd': lambda: [
            _zstd.compress(write_mcap(folder / 'one.mcap', messages).read_bytes()),
        ],
        'sqlite3': lambda: [_only(write_ros2(folder / 'sqlite', messages, 'sqlite3'), '*.db3')],
        'rosbag1': lambda: [
            write_ros1(folder / 'one.bag', stereo_messages(2, factory=ROS1)).read_bytes()
        ],
        'calibration': lambda: [CALIBRATION.encode()],
        'cameras': lambda: [KALIBR.encode(), KITTI.encode(), OPENCV.encode()],
        'parameters': lambda: [config.read_bytes()[:3000]],
        'polygon': lambda: [b'[[0, 1], [2.5, 3], [4, 5]]'],
        'arguments': lambda: [
            b'replay\0bag\0-o\0out\0--set\0max_step=0.2\0--every\0' + b'3',
            b'detect\0l.png\0r.png\0--left-info\0l.yaml\0--right-info\0r.yaml\0-o\0out',
            b'replay\0bag\0-o\0out\0--rectify\0always\0--scheduler\0tcp://rack1:8786',
            b'run\0--camera\0zed\0--namespace\0stereo\0--ros-args\0-p\0upside_down:=true',
        ],
    }
    return made[target]()


CALIBRATION = """\
image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 501.5, 240, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0.0, 0.0, 0.0, 0.0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [400, 0, 310, 0, 0, 400, 230, 0, 0, 0, 1, 0]}
"""

KALIBR = """\
cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.1, 0.02, 0.001, 0]
  distortion_model: radtan
  intrinsics: [500.0, 501.0, 320.0, 240.0]
  resolution: [640, 480]
cam1:
  T_cn_cnm1:
  - [1, 0, 0, -0.2]
  - [0, 1, 0, 0]
  - [0, 0, 1, 0]
  - [0, 0, 0, 1]
  camera_model: pinhole
  distortion_coeffs: [-0.12, 0.03, 0, 0.001]
  distortion_model: radtan
  intrinsics: [505.0, 506.0, 322.0, 238.0]
  resolution: [640, 480]
"""

KITTI = """\
P0: 7.070912e+02 0 3.018873e+02 0 0 7.070912e+02 1.831104e+02 0 0 0 1 0
P1: 7.070912e+02 0 3.018873e+02 -3.798145e+02 0 7.070912e+02 1.831104e+02 0 0 0 1 0
"""

OPENCV = """\
%YAML:1.0
---
P1: !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: [ 500., 0., 320., 0., 0., 500., 240., 0., 0., 0., 1., 0. ]
P2: !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: [ 500., 0., 320., -60., 0., 500., 240., 0., 0., 0., 1., 0. ]
"""


def _only(folder: Path, pattern: str) -> bytes:
    (path,) = folder.glob(pattern)
    return path.read_bytes()
