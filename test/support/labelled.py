"""Small labelled recordings made by hand."""

from __future__ import annotations

import json

import numpy as np
from recordings import (
    FRAME_NS,
    HEIGHT,
    IMAGE,
    INFO,
    ROS2,
    START_NS,
    TEXT,
    WIDTH,
    Recorded,
    stereo_messages,
    write_ros2,
)
from synthetic import Box, mast, render

from rover_obstacle_detection.evaluation.frame import LabelledFrame
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.image import encode_image

SHAPE = (HEIGHT, WIDTH)
ROCK = np.s_[4:20, 2:18]


def labels():
    """A rock of 256 pixels and a row of sky."""
    array = np.zeros(SHAPE, np.uint8)
    array[ROCK] = 1
    array[0] = 255
    return array


def instances():
    array = np.zeros(SHAPE, np.uint16)
    array[ROCK] = 300
    return array


def depth():
    array = np.full(SHAPE, 2.5, np.float32)
    array[0] = np.nan
    return array


def truth(topic, array, number, encoding):
    stamp_ns = START_NS + number * FRAME_NS
    message = encode_image(array, encoding, make_header(stamp_ns, 'left', ROS2), ROS2)
    return Recorded(topic, IMAGE, message, stamp_ns)


def write_labelled(path, *, frames=2, namespace='/truth', scene=None, distortion=(), **given):
    """Write a labelled recording; an array of `given` may be None to leave it out."""
    messages = stereo_messages(frames)
    for each in messages:
        if each.type_name == INFO and distortion:
            each.message.distortion_model = 'plumb_bob'
            each.message.d = np.array(distortion, np.float64)
    for name, make, encoding in (
        ('labels', labels, 'mono8'),
        ('instances', instances, 'mono16'),
        ('depth', depth, '32FC1'),
    ):
        array = given.get(name, make())
        if array is not None:
            for number in range(frames):
                messages.append(truth(f'{namespace}/{name}', array, number, encoding))
    if scene is not None:
        text = scene if isinstance(scene, str) else json.dumps(scene)
        message = ROS2.make(TEXT, data=text)
        messages.append(Recorded(f'{namespace}/scene', TEXT, message, START_NS))
    messages.sort(key=lambda each: each.time_ns)
    return write_ros2(path, messages)


def labelled_view(**changes) -> LabelledFrame:
    """A box on ground, seen by a camera on a mast."""
    scene = mast(solids=(Box(0.0, 1.2, 0.3, 0.3, 0.25),)).with_(**changes)
    view = render(scene)
    return LabelledFrame(
        stamp_ns=1,
        camera=scene.camera,
        left=view.left,
        right=view.right,
        labels=view.obstacle.astype(np.uint8),
        instances=view.obstacle.astype(np.uint16),
        depth_m=view.depth_m.astype(np.float32),
        gravity=scene.gravity,
    )
