"""Copy a simulated bag with the labels of another limit on obstacle height, without rendering.

    python scripts/relabel_bag.py scenes/vga_crater_1 relabelled/vga_crater_1 --max-step 0.2

The limit replaces `truth.clearance_m` and `truth.drop_m`. Compare with
``rover-obstacles evaluate relabelled/vga_crater_1 --set max_step=0.2``.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader

from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.messages.image import decode_float_image, decode_image, encode_image
from rover_obstacle_detection.simulation.description import Scene
from rover_obstacle_detection.simulation.frames import SceneWorld
from rover_obstacle_detection.simulation.renderer import Hits


def relabel(source: Path, target: Path, max_step_m: float) -> None:
    """Copy a bag with new labels.

    Parameters
    ----------
    source : Path
        A bag of `rover-obstacles simulate`, rendered by this version.
    target : Path
        Folder to create.
    max_step_m : float
        Height of the lowest obstacle and depth of the shallowest drop.
    """
    with AnyReader([source]) as reader, BagWriter(target) as writer:
        messages: dict[int, dict[str, tuple[str, Any]]] = {}
        for connection, time_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            messages.setdefault(time_ns, {})[connection.topic] = (connection.msgtype, message)
        first = messages[min(messages)]
        msgtype, text = first['/truth/scene']
        scene = Scene.from_mapping(json.loads(text.data))
        truth = replace(scene.truth, clearance_m=max_step_m, drop_m=max_step_m)
        scene = replace(scene, truth=truth)
        text = writer.factory.make(msgtype, data=json.dumps(scene.to_mapping(), sort_keys=True))
        first['/truth/scene'] = (msgtype, text)
        world = SceneWorld(scene)
        frames = [frame for _, frame in sorted(messages.items()) if '/truth/labels' in frame]
        for pose, frame in zip(world.poses, frames, strict=True):
            depth_m = decode_float_image(frame['/truth/depth'][1], 'depth')
            instances = decode_image(frame['/truth/instances'][1], 'instances')
            rocks = world.rock_mesh(pose)
            labels = world.label(Hits(depth_m, instances), pose, rocks)
            msgtype, old = frame['/truth/labels']
            new = encode_image(labels, 'mono8', old.header, writer.factory)
            frame['/truth/labels'] = (msgtype, new)
        for time_ns, frame in sorted(messages.items()):
            for topic, (msgtype, message) in frame.items():
                writer.add(topic, msgtype, message, time_ns)


def main() -> None:
    """Relabel one bag."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('source', type=Path)
    parser.add_argument('target', type=Path)
    parser.add_argument('--max-step', type=float, required=True, help='limit (m)')
    arguments = parser.parse_args()
    relabel(arguments.source, arguments.target, arguments.max_step)


if __name__ == '__main__':
    main()
