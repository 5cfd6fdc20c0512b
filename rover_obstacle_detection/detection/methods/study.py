"""The study's method, with the errors of its listing corrected."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.frame import Frame
from rover_obstacle_detection.detection.geometry.noise import height_noise_m
from rover_obstacle_detection.detection.geometry.plane_fit import estimate_ground
from rover_obstacle_detection.detection.parameters import DetectorParameters
from rover_obstacle_detection.detection.regions.grey_level import dark_regions
from rover_obstacle_detection.detection.regions.parameters import RegionParameters
from rover_obstacle_detection.detection.regions.segmentation import mean_shift_regions
from rover_obstacle_detection.detection.result.cue import Cue
from rover_obstacle_detection.detection.result.detection import FREE, OBSTACLE, Detection
from rover_obstacle_detection.detection.stereo.empty_matches import remove_empty_matches
from rover_obstacle_detection.detection.stereo.judged_range import too_near
from rover_obstacle_detection.detection.stereo.parameters import StereoParameters
from rover_obstacle_detection.detection.stereo.semi_global import (
    Penalties,
    chosen_penalties,
    plain_disparity,
)
from rover_obstacle_detection.detection.study.limits import exceeds_terrain_limits
from rover_obstacle_detection.detection.study.morphology import close_then_open
from rover_obstacle_detection.detection.study.parameters import StudyParameters
from rover_obstacle_detection.detection.study.products import StudyProducts


def detect_as_study(
    frame: Frame, parameters: DetectorParameters, finished: Callable[[str], None]
) -> Detection:
    """Run the study's method (section 4.2) on one image pair.

    Parameters
    ----------
    frame : Frame
    parameters : DetectorParameters
    finished : callable
        Called with the name of each stage when it ends.
    """
    grey, camera, excluded = frame.pair[0], frame.camera, frame.excluded
    study = parameters.study
    disparity = match_as_study(frame, parameters.stereo, study)
    near = too_near(disparity, camera, parameters.stereo.min_range_m)
    disparity[near] = 0
    finished('disparity')
    ground = estimate_ground(disparity, camera, parameters.plane_fit, frame.gravity)
    finished('ground')
    products = StudyProducts(
        grey=grey,
        disparity=disparity,
        camera=camera,
        up=ground.up_vector,
        segment=partial(segment_as_study, parameters=parameters.regions),
        study=study,
        min_seed_points=parameters.regions.min_seed_points,
    )
    elevation_m = products.elevation_m
    finished('reprojection')
    regions = products.regions
    finished('segmentation')
    is_seed = products.is_seed
    finished('seeds')
    roughness, step = products.roughness, products.step
    finished('terrain')
    rough = exceeds_terrain_limits(roughness, step, disparity, elevation_m, study)
    rough &= products.seeds
    dark = dark_regions(grey, regions, is_seed, study.dark_grey_level)
    cues = np.uint8(Cue.ROUGHNESS_STEP) * rough + np.uint8(Cue.GREY_LEVEL) * dark[regions]
    finished('decision')
    mask = close_then_open(
        np.where(cues, OBSTACLE, FREE).astype(np.uint8),
        study.morphology_size_px,
        study.morphology_iterations,
    )
    excluded = near if excluded is None else near | excluded
    mask[excluded] = FREE
    # The study calls bright regions without enough 3D free. Here they are unknown.
    known = ((disparity > 0) & products.seeds | (mask == OBSTACLE)) & ~excluded
    finished('morphology')
    return Detection(
        camera=camera,
        parameters=parameters,
        ground=ground,
        grey=grey,
        disparity=disparity,
        height=elevation_m + np.float32(ground.height_m),
        height_noise=height_noise_m(disparity, ground.height_m, study.disparity_noise_px),
        rock_probability=np.full(camera.shape, np.nan, np.float32),
        cues=cues,
        known=known,
        mask=mask,
        study=products,
    )


def match_as_study(
    frame: Frame, stereo: StereoParameters, study: StudyParameters
) -> NDArray[np.float32]:
    """Match densely and filter outliers (study, section 4.2 step 2).

    Returns
    -------
    ndarray of float32, shape (height, width)
        Disparity in pixels, without the camera's offset; 0 where there is no match, beyond the
        maximum range and on the rover.
    """
    penalties = chosen_penalties(stereo, Penalties(study.step_penalty, study.jump_penalty))
    matched = plain_disparity(*frame.pair, frame.camera, study.disparities, penalties, stereo)
    remove_empty_matches(matched, frame.pair, frame.camera, stereo)
    disparity = np.asarray(cv2.medianBlur(matched, study.median_window_px), np.float32)
    disparity[disparity < frame.camera.disparity_at(study.max_range_m)] = 0
    if frame.excluded is not None:
        disparity[frame.excluded] = 0
    return disparity


def segment_as_study(grey: NDArray[np.uint8], parameters: RegionParameters) -> NDArray[np.int32]:
    """Segment the image with the configured bandwidths (study, section 4.2 step 4)."""
    return mean_shift_regions(
        grey,
        parameters.mean_shift_spatial_radius_px,
        parameters.mean_shift_color_radius,
        parameters.min_region_size_px,
    )
