"""The resolutions at which a pair is measured and outlined: the rover's step sets them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import ResolutionParameters

# The plane is sampled on a grid of this size.
_COLUMNS, _ROWS = 32, 24


def working_camera(
    camera: StereoCamera, ground: GroundPlane, parameters: ResolutionParameters
) -> StereoCamera:
    """Choose the resolution that shows the rover's step in enough pixels to measure it.

    Parameters
    ----------
    camera : StereoCamera
    ground : GroundPlane
    parameters : ResolutionParameters

    Returns
    -------
    StereoCamera
        Of the reduced images; the given one where they keep their size.
    """
    return _reduced(camera, ground, parameters)


def outline_camera(
    camera: StereoCamera, ground: GroundPlane, parameters: ResolutionParameters
) -> StereoCamera:
    """Choose the resolution that shows the rover's step in enough pixels to outline it.

    Parameters and return value are those of `working_camera`.
    """
    p = parameters
    finer = replace(p, step_px=p.outline_step_px, min_pixels=p.outline_min_pixels)
    return _reduced(camera, ground, finer)


def _reduced(camera: StereoCamera, ground: GroundPlane, p: ResolutionParameters) -> StereoCamera:
    scale = p.scale or _scale_for_step(camera, ground, p)
    scale = max(scale, p.min_side_px / min(camera.shape))
    if scale >= p.max_scale:
        return camera
    return camera.resized(round(camera.width * scale), round(camera.height * scale))


def _scale_for_step(camera: StereoCamera, ground: GroundPlane, p: ResolutionParameters) -> float:
    least = math.sqrt(p.min_pixels / (camera.width * camera.height))
    grid = camera.resized(_COLUMNS, _ROWS)
    disparity = DisparityPlane.from_ground(ground, grid).disparity(grid)
    in_range = disparity[disparity > grid.disparity_at(p.max_range_m)]
    if not in_range.size:
        return least
    far = float(np.quantile(in_range, p.far_share)) * camera.width / grid.width
    step_px = far / camera.baseline_m * p.max_step_m
    return max(p.step_px / step_px, least)
