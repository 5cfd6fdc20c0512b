"""Run the detector on one pair of image files."""

from __future__ import annotations

import logging
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.calibration_files.request import CalibrationRequest
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detector import Detector
from rover_obstacle_detection.detection.result.detection import Detection
from rover_obstacle_detection.errors import ImageError
from rover_obstacle_detection.messages.image import decode_compressed_image, halves
from rover_obstacle_detection.messages.rectification import (
    StereoRectification,
    needs_rectification,
)
from rover_obstacle_detection.offline.output_file import atomic_write_json
from rover_obstacle_detection.offline.output_folder import output_folder
from rover_obstacle_detection.offline.picture_files import PICTURE_NAMES, write_pictures, write_png
from rover_obstacle_detection.offline.ply import write_ply
from rover_obstacle_detection.offline.stopwatch import Stopwatch
from rover_obstacle_detection.offline.summary import FrameSummary, obstacle_json, preamble
from rover_obstacle_detection.pictures import shown_obstacles
from rover_obstacle_detection.rover_mask import RoverMask
from rover_obstacle_detection.swapped_images import detect_unswapped

_logger = logging.getLogger(__name__)

OUTPUT_FILES = (
    'mask.png',
    'points.ply',
    'summary.json',
    *(f'{name}.png' for name in PICTURE_NAMES),
)


def detect_pair(
    left: Path,
    right: Path | None,
    calibration: CalibrationRequest,
    config: DetectorConfig,
    output: Path,
    *,
    rover: RoverMask | None = None,
    raw: bool = False,
    force: bool = False,
) -> Detection:
    """Detect obstacles in two image files and write the results.

    `output` is written atomically: ``mask.png`` (0 free, 255 obstacle), ``points.ply``,
    ``summary.json``, the overlay and the study's pictures.

    Parameters
    ----------
    left, right : Path
        Images, grey or colour; rectified, unless `raw` is set. Without `right`, `left` shows both
        views side by side.
    calibration : CalibrationRequest
    config : DetectorConfig
    output : Path
    rover : RoverMask, optional
        Pixels that show the rover itself.
    raw : bool
        Rectify the images with K, D, R and P of the calibration.
    force : bool
        Replace the files of a previous run.

    Raises
    ------
    ObstacleDetectionError
        If a file cannot be read, the files do not match or the pair cannot be judged.
    """
    left_image = read_image(left)
    names = str(left), str(right or left)
    if right is None:
        left_image, right_image = halves(left_image, names[0])
    else:
        right_image = read_image(right)
    height, width = left_image.shape[:2]
    stereo = calibration.calibration(lambda: (width, height), str(left))
    camera = stereo.camera
    if raw:
        rectification = StereoRectification(stereo)
        if not rectification.is_needed:
            _logger.warning(
                '--raw: no distortion or rotation in %s: nothing is rectified', stereo.source
            )
        left_image, right_image = rectification(left_image, right_image)
    elif needs_rectification(stereo.left) or needs_rectification(stereo.right):
        _logger.warning(
            'a lens distortion or rotation is in %s, but the images are taken as rectified; give '
            '--raw if they are not',
            stereo.source,
        )
    detector = Detector(camera, config, rover.pixels(*camera.shape) if rover else None)
    stopwatch = Stopwatch()
    detection = detect_unswapped(detector, left_image, right_image, *names, on_stage=stopwatch.lap)
    stage_ms = stopwatch.take_ms()
    with output_folder(output, force=force, replaces=OUTPUT_FILES) as folder:
        write_png(folder / 'mask.png', detection.mask)
        write_ply(folder / 'points.ply', detection.obstacle_points, detection.ground_points)
        write_pictures(detection, left_image, folder)
        atomic_write_json(
            folder / 'summary.json',
            {
                **preamble('detect', config),
                'images': dict(zip(('left', 'right'), names, strict=True)),
                'calibration': stereo.source,
                'camera': asdict(camera),
                **FrameSummary.of(detection).as_json(),
                'warnings': list(detection.warnings),
                'obstacle_list': [obstacle_json(each) for each in shown_obstacles(detection)],
                'stage_ms': stage_ms,
            },
        )
    return detection


def read_image(path: Path) -> NDArray[Any]:
    """Read an image file for the detector.

    Returns
    -------
    ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Grey or BGR.

    Raises
    ------
    ImageError
        If the file cannot be read or is not a complete image.
    """
    try:
        data = np.fromfile(path, np.uint8)
    except OSError as error:
        raise ImageError(f'{path}: cannot be read: {error.strerror}') from error
    return decode_compressed_image(
        SimpleNamespace(format=path.suffix.lstrip('.'), data=data), str(path)
    )
