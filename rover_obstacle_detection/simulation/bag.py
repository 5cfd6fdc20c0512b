"""Labelled bags: the stereo images and the ground truth of a scene in one recording."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.image import encode_image
from rover_obstacle_detection.simulation.description import Scene
from rover_obstacle_detection.simulation.frames import Frame

LEFT_FRAME_ID = 'stereo_left_optical_frame'
RIGHT_FRAME_ID = 'stereo_right_optical_frame'
WORLD_FRAME_ID = 'world'

_START_NS = 1_700_000_000_000_000_000
"""Stamp of the first pair. A fixed one makes bags reproducible."""

_IMAGE = 'sensor_msgs/msg/Image'
_INFO = 'sensor_msgs/msg/CameraInfo'
_POSE = 'geometry_msgs/msg/PoseStamped'
_TRANSFORM = 'tf2_msgs/msg/TFMessage'
_TEXT = 'std_msgs/msg/String'


def write_labelled_bag(path: Path, scene: Scene, frames: Iterable[Frame]) -> None:
    """Write a labelled bag (rosbag2, mcap).

    Parameters
    ----------
    path : Path
        Folder to create.
    scene : Scene
        Stored as JSON on ``/truth/scene``.
    frames : iterable of Frame

    Raises
    ------
    OutputError
        If the folder exists or cannot be written.
    """
    with BagWriter(path) as writer:
        text = json.dumps(scene.to_mapping(), sort_keys=True)
        message = writer.factory.make(_TEXT, data=text)
        writer.add('/truth/scene', _TEXT, message, _START_NS)
        for number, frame in enumerate(frames):
            stamp_ns = _START_NS + round(number * scene.drive.period_s * 1e9)
            for topic, type_name, message in _messages(frame, stamp_ns, writer.factory):
                writer.add(topic, type_name, message, stamp_ns)


def _messages(frame: Frame, stamp_ns: int, factory: Any) -> Iterable[tuple[str, str, Any]]:
    """Yield topic, type and message of everything recorded with one pair."""
    left_header = make_header(stamp_ns, LEFT_FRAME_ID, factory)
    right_header = make_header(stamp_ns, RIGHT_FRAME_ID, factory)
    for side, header, image in (
        ('left', left_header, frame.left),
        ('right', right_header, frame.right),
    ):
        yield f'/stereo/{side}/camera_info', _INFO, _camera_info(frame, side, header, factory)
        message = encode_image(image, _encoding(image), header, factory)
        yield f'/stereo/{side}/image_rect', _IMAGE, message
    for name, array, encoding in (
        ('labels', frame.labels, 'mono8'),
        ('instances', frame.instances, 'mono16'),
        ('depth', frame.depth_m, '32FC1'),
    ):
        yield f'/truth/{name}', _IMAGE, encode_image(array, encoding, left_header, factory)
    yield from _pose_messages(frame, make_header(stamp_ns, WORLD_FRAME_ID, factory), factory)


def _pose_messages(frame: Frame, header: Any, factory: Any) -> Iterable[tuple[str, str, Any]]:
    def geometry(name: str, **fields: Any) -> Any:
        return factory.make(f'geometry_msgs/msg/{name}', **fields)

    position = dict(zip('xyz', map(float, frame.pose.position), strict=True))
    rotation = geometry('Quaternion', **dict(zip('xyzw', frame.pose.quaternion, strict=True)))
    pose = geometry('Pose', position=geometry('Point', **position), orientation=rotation)
    yield '/truth/pose', _POSE, factory.make(_POSE, header=header, pose=pose)
    transform = geometry(
        'TransformStamped',
        header=header,
        child_frame_id=LEFT_FRAME_ID,
        transform=geometry(
            'Transform', translation=geometry('Vector3', **position), rotation=rotation
        ),
    )
    yield '/tf', _TRANSFORM, factory.make(_TRANSFORM, transforms=[transform])


def _encoding(image: NDArray[Any]) -> str:
    if image.ndim == 3:
        return 'rgb8'
    return 'mono8' if image.dtype == np.uint8 else 'mono16'


def _camera_info(frame: Frame, side: str, header: Any, factory: Any) -> Any:
    camera = frame.camera
    shift = -camera.fx * camera.baseline_m if side == 'right' else 0.0
    k = [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]
    p = [camera.fx, 0, camera.cx, shift, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0]
    return factory.make(
        _INFO,
        header=header,
        width=camera.width,
        height=camera.height,
        distortion_model='plumb_bob',
        d=np.zeros(5),
        k=np.array(k, np.float64),
        r=np.identity(3).reshape(-1),
        p=np.array(p, np.float64),
    )
