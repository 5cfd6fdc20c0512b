"""Create the labelled bag ``bags/mars_yard`` from three rendered scenes with exact ground truth.

    python scripts/make_sample_bag.py SAMPLES bags/mars_yard

SAMPLES has a folder for each scene with ``left.png``, ``right.png``, ``disparity_x256.png``,
``labels.png``, ``instances.png`` and ``scene.json``. The output is byte-identical for the same
scenes and library versions. ``bags/README.md`` describes the content.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.evaluation.labels import FREE, NOT_COUNTED, ROCK
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.image import encode_image

SCENES = ('nominal_noon', 'low_sun', 'crater')
FIRST_STAMP_NS = 1_700_000_000_000_000_000
PERIOD_NS = 1_000_000_000
NAMESPACE = '/stereo'
FRAMES = {'left': 'stereo_left_optical_frame', 'right': 'stereo_right_optical_frame'}
NO_INSTANCE = 65535  # pixels without a surface in instances.png
DISPARITY_SCALE = 256  # of disparity_x256.png
AMBIGUITY = 0.2  # of the clearance; rocks this close to it are not counted
GROUND_RING_PX = 25  # ground used around a rock cut by the frame
MIN_GROUND_PIXELS = 100  # for a plane through that ground


class Scene(NamedTuple):
    """One rendered pair and its ground truth, as published in the bag."""

    camera: StereoCamera
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    instances: NDArray[np.uint16]
    depth_m: NDArray[np.float32]


def load_scene(folder: Path) -> Scene:
    """Read a scene and compute its final labels."""
    facts = json.loads((folder / 'scene.json').read_text(encoding='utf-8'))
    camera = StereoCamera(
        width=facts['width'],
        height=facts['height'],
        fx=facts['fx'],
        fy=facts['fy'],
        cx=facts['cx'],
        cy=facts['cy'],
        baseline_m=facts['baseline'],
    )
    scaled = _read(folder / 'disparity_x256.png').astype(np.float32)
    disparity = scaled / np.float32(DISPARITY_SCALE)
    points = reproject(disparity, camera)
    instances = _read(folder / 'instances.png')
    instances[instances == NO_INSTANCE] = 0
    pitch = math.radians(facts['pitch_deg'])
    up = np.array((0.0, -math.cos(pitch), -math.sin(pitch)), np.float32)
    return Scene(
        camera=camera,
        # Colour would triple the size of the bag.
        left=_grey(_read(folder / 'left.png')),
        right=_grey(_read(folder / 'right.png')),
        labels=final_labels(
            _read(folder / 'labels.png'),
            instances,
            points,
            up,
            np.array(facts['rock_height']),
            facts['clearance'],
        ),
        instances=instances,
        depth_m=points[..., 2],
    )


def final_labels(
    labels: NDArray[np.uint8],
    instances: NDArray[np.uint16],
    points: NDArray[np.float32],
    up: NDArray[np.float32],
    rock_height_m: NDArray[np.float64],
    clearance_m: float,
) -> NDArray[np.uint8]:
    """Exclude rocks that are neither clearly obstacles nor clearly free.

    These are rocks within 20 % of the clearance, and taller rocks cut by the frame whose visible
    part rises at most 1.2 times the clearance above the ground around it.

    Parameters
    ----------
    labels : ndarray of uint8, shape (height, width)
        0 free, 1 rock taller than the clearance, 2 slope, 3 drop, 255 no surface.
    instances : ndarray of uint16, shape (height, width)
        0 ground, otherwise the number of the rock.
    points : ndarray of float32, shape (height, width, 3)
        Metres in the left optical frame.
    up : ndarray of float32, shape (3,)
        Unit vector in the left optical frame.
    rock_height_m : ndarray of float64, shape (rocks + 1,)
        Full height of each rock, by instance number.
    clearance_m : float

    Returns
    -------
    ndarray of uint8, shape (height, width)
        The labels, 255 where not counted.
    """
    limit_m = AMBIGUITY * clearance_m + 1e-9
    ambiguous = np.abs(rock_height_m - clearance_m) <= limit_m
    ambiguous[0] = False
    for rock in _cut_by_the_frame(instances):
        whole_m = rock_height_m[rock]
        if whole_m > clearance_m and not (
            visible_height_m(instances, rock, points, up) > (1 + AMBIGUITY) * clearance_m
        ):
            ambiguous[rock] = True
    # Slopes and drops remain obstacles even below an ambiguous rock.
    of_a_rock = ambiguous[instances] & np.isin(labels, (FREE, ROCK))
    return np.where(of_a_rock, NOT_COUNTED, labels).astype(np.uint8)


def visible_height_m(
    instances: NDArray[np.uint16],
    rock: int,
    points: NDArray[np.float32],
    up: NDArray[np.float32],
) -> float:
    """Measure the height of a rock's visible part above a plane through the surrounding ground.

    Returns
    -------
    float
        Metres; NaN if too little ground is visible.
    """
    visible = instances == rock
    size = 2 * GROUND_RING_PX + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    around = cv2.dilate(visible.astype(np.uint8), kernel) > 0
    ground = around & (instances == 0) & np.isfinite(points[..., 2])
    if np.count_nonzero(ground) < MIN_GROUND_PIXELS:
        return math.nan
    elevation = points @ up
    forward = points - elevation[..., np.newaxis] * up
    design = np.column_stack((forward[ground][:, [0, 2]], np.ones(np.count_nonzero(ground))))
    plane, *_ = np.linalg.lstsq(design, elevation[ground], rcond=None)
    over = visible & np.isfinite(points[..., 2])
    level = forward[over][:, [0, 2]] @ plane[:2] + plane[2]
    return float((elevation[over] - level).max())


def write_bag(scenes: list[Scene], path: Path) -> None:
    """Write the scenes as pairs at 1 Hz with calibration and ground truth."""
    with BagWriter(path) as bag:
        for index, scene in enumerate(scenes):
            stamp_ns = FIRST_STAMP_NS + index * PERIOD_NS
            for side, image in (('left', scene.left), ('right', scene.right)):
                header = make_header(stamp_ns, FRAMES[side], bag.factory)
                info = _camera_info(scene.camera, side, header, bag.factory)
                bag.add(
                    f'{NAMESPACE}/{side}/camera_info',
                    'sensor_msgs/msg/CameraInfo',
                    info,
                    stamp_ns,
                )
                _add_image(bag, f'{NAMESPACE}/{side}/image_rect', image, 'mono8', header, stamp_ns)
            header = make_header(stamp_ns, FRAMES['left'], bag.factory)
            truth: list[tuple[str, NDArray[Any], str]] = [
                ('labels', scene.labels, 'mono8'),
                ('instances', scene.instances, 'mono16'),
                ('depth', scene.depth_m, '32FC1'),
            ]
            for name, image, encoding in truth:
                _add_image(bag, f'/truth/{name}', image, encoding, header, stamp_ns)


def _add_image(
    bag: BagWriter,
    topic: str,
    image: NDArray[Any],
    encoding: str,
    header: Any,
    stamp_ns: int,
) -> None:
    message = encode_image(image, encoding, header, bag.factory)
    bag.add(topic, 'sensor_msgs/msg/Image', message, stamp_ns)


def _camera_info(camera: StereoCamera, side: str, header: Any, factory: Any) -> Any:
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    shift = -fx * camera.baseline_m if side == 'right' else 0.0
    return factory.make(
        'sensor_msgs/msg/CameraInfo',
        header=header,
        height=camera.height,
        width=camera.width,
        distortion_model='plumb_bob',
        d=np.zeros(5),
        k=np.array((fx, 0, cx, 0, fy, cy, 0, 0, 1), np.float64),
        r=np.identity(3).ravel(),
        p=np.array((fx, 0, cx, shift, 0, fy, cy, 0, 0, 0, 1, 0), np.float64),
    )


def _cut_by_the_frame(instances: NDArray[np.uint16]) -> list[int]:
    border = np.concatenate(
        (instances[0], instances[-1], instances[:, 0], instances[:, -1]), dtype=np.int64
    )
    return [int(rock) for rock in np.unique(border) if rock]


def _grey(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _read(path: Path) -> NDArray[Any]:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise SystemExit(f'{path}: expected an image')
    return image


def main() -> None:
    """Read the scenes and write the bag."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('samples', type=Path, help='folder of the rendered scenes')
    parser.add_argument('bag', type=Path, help='bag to write')
    arguments = parser.parse_args()
    scenes = [load_scene(arguments.samples / name) for name in SCENES]
    write_bag(scenes, arguments.bag)


if __name__ == '__main__':
    main()
