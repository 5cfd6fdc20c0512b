"""Small scenes, detections and recordings made by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from synthetic import Box, mast, render

from rover_obstacle_detection.bags.writer import BagWriter
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import GroundPlane
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import OBSTACLE, Detection
from rover_obstacle_detection.detection.study.products import StudyProducts
from rover_obstacle_detection.messages.header import make_header
from rover_obstacle_detection.messages.image import encode_image

SCENE = mast(solids=(Box(0.1, 1.2, 0.25, 0.25, 0.2),))
CAMERA = SCENE.camera
FIRST_STAMP_NS = 1_700_000_000_000_000_000


def small_detection(camera=None, **changes):
    """A detection of 48 x 64 pixels: one obstacle of 12 x 14, two columns not judged.

    `changes` replace fields of the detection, or its regions, seeds, roughness and step.
    """
    shape = (48, 64)
    camera = camera or StereoCamera(64, 48, 60.0, 60.0, 31.5, 23.5, 0.1)
    obstacle = np.zeros(shape, bool)
    obstacle[32:44, 30:44] = True
    disparity = np.where(obstacle, 4.0, 3.0).astype(np.float32)
    disparity[:, :2] = 0
    up = Gravity.from_angles(46.0).up
    fields = {
        'parameters': DetectorParameters.from_config(DetectorConfig(ground_cell=0.0)),
        'ground': GroundPlane(up, 1.0, up),
        'grey': np.full(shape, 100, np.uint8),
        'disparity': disparity,
        'height': np.where(obstacle, 0.21, 0.0).astype(np.float32),
        'height_noise': np.full(shape, 0.01, np.float32),
        'cues': obstacle * np.uint8(Cue.HEIGHT),
        'known': disparity > 0,
        'mask': obstacle * np.uint8(OBSTACLE),
    }
    products = {
        'regions': np.where(obstacle, 2, 1).astype(np.int32),
        'seeds': np.ones(shape, bool),
        'roughness': np.full(shape, 0.001, np.float32),
        'step': np.full(shape, 0.002, np.float32),
    }
    products = {name: changes.pop(name, product) for name, product in products.items()}
    fields |= changes
    fields.setdefault('rock_probability', np.full(fields['mask'].shape, np.nan, np.float32))
    study = StudyProducts(
        fields['grey'],
        fields['disparity'],
        camera,
        fields['ground'].up_vector,
        lambda grey: products['regions'],
        fields['parameters'].study,
        fields['parameters'].regions.min_seed_points,
    )
    # Given products take the place of those computed on first access.
    vars(study).update(products)
    return Detection(camera=camera, study=study, **fields)


def stereo_images():
    """Left and right image of a block on flat ground."""
    view = render(SCENE)
    return view.left, view.right


def camera_info(factory, header, side, camera=CAMERA, **changes):
    """`CameraInfo` of one side; `changes` replace fields of the message."""
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    shift = -fx * camera.baseline_m if side == 'right' else 0.0
    fields = {
        'header': header,
        'width': camera.width,
        'height': camera.height,
        'distortion_model': 'plumb_bob',
        'd': np.zeros(5),
        'k': np.array((fx, 0, cx, 0, fy, cy, 0, 0, 1), np.float64),
        'r': np.identity(3).ravel(),
        'p': np.array((fx, 0, cx, shift, 0, fy, cy, 0, 0, 0, 1, 0), np.float64),
        **changes,
    }
    return factory.make('sensor_msgs/msg/CameraInfo', **fields)


def write_stereo_bag(
    path: Path,
    pairs=3,
    *,
    images=None,
    right_delay_ns=0,
    period_ns=100_000_000,
    sides=('left', 'right'),
    infos=True,
    encoding='mono8',
    name='image_rect',
    change_image=None,
    change_info=None,
):
    """Write a recording of a stereo camera in ``/cam``.

    `change_image(index, side, message)` and `change_info(side, message)` may change a message
    before it is written.
    """
    images = images or [stereo_images()]
    with BagWriter(path) as bag:
        for index in range(pairs):
            for side, image in zip(('left', 'right'), images[index % len(images)], strict=True):
                if side not in sides:
                    continue
                delay_ns = right_delay_ns if side == 'right' else 0
                stamp_ns = FIRST_STAMP_NS + index * period_ns + delay_ns
                header = make_header(stamp_ns, f'{side}_optical', bag.factory)
                message = encode_image(image, encoding, header, bag.factory)
                if change_image:
                    message = change_image(index, side, message) or message
                kind = 'CompressedImage' if hasattr(message, 'format') else 'Image'
                bag.add(f'/cam/{side}/{name}', f'sensor_msgs/msg/{kind}', message, stamp_ns)
                if infos:
                    info = camera_info(bag.factory, header, side)
                    if change_info:
                        change_info(side, info)
                    bag.add(
                        f'/cam/{side}/camera_info',
                        'sensor_msgs/msg/CameraInfo',
                        info,
                        stamp_ns,
                    )
    return path


def write_side_by_side_bag(path: Path, images, *, topic='/zed/image_rect', change_image=None):
    """Write a recording of one topic whose images show both views, without a calibration."""
    with BagWriter(path) as bag:
        for index, pair in enumerate(images):
            stamp_ns = FIRST_STAMP_NS + index * 100_000_000
            header = make_header(stamp_ns, 'camera', bag.factory)
            message = encode_image(np.hstack(pair), 'mono8', header, bag.factory)
            if change_image:
                change_image(index, message)
            bag.add(topic, 'sensor_msgs/msg/Image', message, stamp_ns)
    return path


def write_calibration(folder: Path, camera=CAMERA):
    """Write the calibration files of both cameras and return their paths."""
    for side in ('left', 'right'):
        shift = -camera.fx * camera.baseline_m if side == 'right' else 0.0
        intrinsic = [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]
        projection = [camera.fx, 0, camera.cx, shift, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0]
        (folder / f'{side}.yaml').write_text(
            f'image_width: {camera.width}\n'
            f'image_height: {camera.height}\n'
            f'camera_name: {side}\n'
            'distortion_model: plumb_bob\n'
            f'camera_matrix: {{rows: 3, cols: 3, data: {intrinsic}}}\n'
            'distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n'
            'rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n'
            f'projection_matrix: {{rows: 3, cols: 4, data: {projection}}}\n'
        )
    return folder / 'left.yaml', folder / 'right.yaml'
