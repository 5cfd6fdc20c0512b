"""The study's method with its listed errors mended and its own parameters."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.noise import (
    DISPARITY_NOISE_PX,
    WINDOW_NOISE_PX,
    height_noise_m,
)
from rover_obstacle_detection.detection.geometry.plane_fit import estimate_ground
from rover_obstacle_detection.detection.geometry.reprojection import reproject
from rover_obstacle_detection.detection.images.grey_pair import GreyPair
from rover_obstacle_detection.detection.regions.grey_level import dark_regions
from rover_obstacle_detection.detection.regions.regions import seed_regions
from rover_obstacle_detection.detection.regions.segmentation import mean_shift_regions
from rover_obstacle_detection.detection.result.detection import FREE, OBSTACLE, Cue, Detection
from rover_obstacle_detection.detection.stereo.semi_global import (
    Penalties,
    penalties,
    plain_disparity,
)
from rover_obstacle_detection.detection.study.morphology import close_then_open
from rover_obstacle_detection.detection.study.window_terrain import (
    elevation_along,
    window_roughness,
    window_step,
)

DISPARITIES = 48
PENALTIES = Penalties(one=8 * 3 * 5 * 5, more=32 * 3 * 5 * 5)
GROUND_TOLERANCE_M = 0.05

# The range of 25 samples of unit noise averages 3.9, with a spread of 0.7 (Tippett 1925), their
# mean deviation 0.8 with 0.12: three spreads more is what noise alone does not reach.
_NOISE_STEP = 6.0
_NOISE_ROUGHNESS = 1.2


def detect_as_study(
    pair: GreyPair,
    camera: StereoCamera,
    config: DetectorConfig,
    gravity: Gravity | None,
    rover_mask: NDArray[np.bool_] | None,
    finished: Callable[[str], None],
) -> Detection:
    """Run the study's chain (section 4.2) on one pair.

    Parameters
    ----------
    pair : tuple of two ndarray of uint8, shape (height, width)
    camera : StereoCamera
    config : DetectorConfig
    gravity : Gravity, optional
        The vertical, where known.
    rover_mask : ndarray of bool, shape (height, width), optional
        Pixels that show the rover: without 3D, and never judged.
    finished : callable
        Told the name of each stage as it ends.
    """
    grey = pair[0]
    count = config.disparity_range or DISPARITIES
    disparity = plain_disparity(*pair, camera, count, config, penalties(config, PENALTIES))
    disparity = np.asarray(cv2.medianBlur(disparity, 5), np.float32)
    disparity[disparity < camera.disparity_at(config.max_range)] = 0
    if rover_mask is not None:
        disparity[rover_mask] = 0
    finished('disparity')
    points = reproject(disparity, camera)
    has_point = disparity > 0
    finished('reprojection')
    ground = estimate_ground(disparity, camera, config, gravity)
    elevation_m = elevation_along(points, ground.up_vector)
    finished('ground')
    regions = mean_shift_regions(
        grey,
        config.mean_shift_spatial_radius,
        config.mean_shift_color_radius,
        config.min_region_size,
    )
    finished('segmentation')
    is_seed = seed_regions(regions, has_point, config.min_seed_points)
    finished('seeds')
    roughness = window_roughness(disparity, camera, config.window_size)
    step = window_step(elevation_m, config.window_size)
    finished('terrain')
    rough = exceeds_terrain_limits(roughness, step, disparity, elevation_m, config)
    dark = dark_regions(grey, regions, is_seed, config.dark_grey_level)
    rough &= is_seed[regions]
    cues = np.uint8(Cue.ROUGHNESS_STEP) * rough + np.uint8(Cue.GREY_LEVEL) * dark[regions]
    finished('decision')
    mask = close_then_open(
        np.where(cues, OBSTACLE, FREE).astype(np.uint8),
        config.morphology_size,
        config.morphology_iterations,
    )
    if rover_mask is not None:
        mask[rover_mask] = FREE
    finished('morphology')
    known = has_point | ~is_seed[regions]
    if rover_mask is not None:
        known &= ~rover_mask
    return Detection(
        camera=camera,
        config=config,
        ground=ground,
        products={
            'grey': grey,
            'disparity': disparity,
            'regions': regions,
            'seeds': lambda: is_seed[regions],
            'roughness': roughness,
            'step': step,
            'height': lambda: elevation_m + np.float32(ground.height_m),
            'height_noise': lambda: height_noise_m(disparity, ground.height_m, DISPARITY_NOISE_PX),
            'cues': cues,
            'known': known,
            'mask': mask,
        },
    )


def exceeds_terrain_limits(
    roughness: NDArray[np.float32],
    step: NDArray[np.float32],
    disparity: NDArray[np.float32],
    elevation_m: NDArray[np.float32],
    config: DetectorConfig,
) -> NDArray[np.bool_]:
    """Compare each window with T2 and T3, each widened by what noise alone would give.

    Parameters
    ----------
    roughness, step : ndarray of float32, shape (height, width)
        Metres; NaN where none.
    disparity : ndarray of float32, shape (height, width)
        Pixels; 0 where there is no match.
    elevation_m : ndarray of float32, shape (height, width)
        Relative to the left eye, metres.
    config : DetectorConfig

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    A disparity off by a share s moves a point by that share along its ray, so its elevation by
    ``|E| s`` with ``s = sigma_d / d``.
    """
    with np.errstate(divide='ignore', invalid='ignore'):
        noise_m = np.abs(elevation_m) * np.float32(WINDOW_NOISE_PX) / disparity
        max_roughness = np.hypot(config.study_max_roughness, _NOISE_ROUGHNESS * noise_m)
        max_step = np.hypot(config.study_max_step, _NOISE_STEP * noise_m)
        return np.asarray((roughness > max_roughness) | (step > max_step))
