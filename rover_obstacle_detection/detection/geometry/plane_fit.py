"""Robust fit of the ground plane in disparity, where stereo noise is uniform."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import PlaneFitParameters


def estimate_ground(
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
    gravity: Gravity | None,
) -> GroundPlane:
    """Estimate the visible ground, or fall back to the known mounting.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    camera : StereoCamera
        Of the disparity's size.
    parameters : PlaneFitParameters
    gravity : Gravity, optional
        The vertical, where it is known.

    Returns
    -------
    GroundPlane
        If no plane is found: level ground at the known or default height. Without gravity the
        camera is assumed level.

    Notes
    -----
    Only the nearer part of the matches counts. The rover stands next to it, so its normal is the
    best estimate of the vertical.
    """
    min_disparity = camera.disparity_at(parameters.max_range_m)
    matched = disparity[disparity > min_disparity]
    if matched.size:
        min_disparity = float(np.quantile(matched, 1 - parameters.near_share))
    plane = fit_ground_plane(
        disparity, camera, parameters, min_disparity=min_disparity, gravity=gravity
    )
    if plane is not None:
        return plane.in_space(camera, gravity)
    up = gravity.up if gravity else (0.0, -1.0, 0.0)
    height_m = (gravity.height_m if gravity else None) or parameters.default_height_m
    return GroundPlane(normal=up, height_m=height_m, up=up, measured=False)


def fit_ground_plane(
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
    *,
    min_disparity: float,
    gravity: Gravity | None = None,
) -> DisparityPlane | None:
    """Fit the plane that most points lie on and few lie below.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    camera : StereoCamera
        Of the disparity's size.
    parameters : PlaneFitParameters
    min_disparity : float
        Farther points are excluded, pixels.
    gravity : Gravity, optional
        The vertical, where it is known. The plane's slope is then limited.

    Returns
    -------
    DisparityPlane or None
        None if too little is matched or no plane can be ground.

    Notes
    -----
    Candidates through three random points are scored by MSAC (Torr and Zisserman 2000). The seed
    is fixed, so that a pair always gives the same plane. The best candidate is refined by
    iteratively reweighted least squares with Cauchy weights. Residuals are heights, ``h r / d``,
    over tolerance and noise.
    """
    points = _sample(disparity, camera, min_disparity, parameters.sample_points)
    if len(points) < parameters.min_points:
        return None
    candidates = _candidates(points, camera, parameters, gravity)
    if not len(candidates):
        return None
    best = candidates[np.argmin(_costs(candidates, points, camera, parameters))]
    for _ in range(parameters.refinements):
        refined = _reweighted(best, points, camera, parameters)
        if not _plausible(refined[np.newaxis], camera, parameters, gravity).all():
            break
        best = refined
    return DisparityPlane(*(float(value) for value in best))


def _sample(
    disparity: NDArray[np.float32], camera: StereoCamera, min_disparity: float, count: int
) -> NDArray[np.float64]:
    """Rows of (column, row, disparity) relative to the principal point, evenly thinned."""
    rows, columns = np.nonzero(disparity > max(min_disparity, 1e-3))
    thin = max(1, len(rows) // count)
    rows, columns = rows[::thin], columns[::thin]
    return np.column_stack((columns - camera.cx, rows - camera.cy, disparity[rows, columns]))


def _candidates(
    points: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
    gravity: Gravity | None,
) -> NDArray[np.float64]:
    """Rows of (slope_u, slope_v, level): plausible planes through three points each."""
    generator = np.random.default_rng(0)
    triples = generator.integers(len(points), size=(parameters.candidates, 3))
    corners = points[triples]
    design = corners.copy()
    design[:, :, 2] = 1.0
    usable = np.abs(np.linalg.det(design)) / 2 > parameters.min_sample_area_px2
    planes = np.linalg.solve(design[usable], corners[usable][:, :, 2:])[:, :, 0]
    return planes[_plausible(planes, camera, parameters, gravity)]


def _plausible(
    planes: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
    gravity: Gravity | None,
) -> NDArray[np.bool_]:
    """Select the planes that can be ground."""
    normals = -planes * (camera.fx, camera.fy, 1.0)
    length = np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    normals /= length
    high = camera.fx * camera.baseline_m / length[:, 0] > parameters.min_height_m
    if gravity is not None:
        upright = normals @ np.asarray(gravity.up) > _cosine(parameters.max_slope_deg)
        return np.asarray(upright & high)
    upward = -normals[:, 1] > _cosine(parameters.max_pitch_deg)
    rolled = np.abs(normals[:, 0]) < _sine(parameters.max_roll_deg)
    looking_down = normals[:, 2] < _sine(parameters.max_looking_up_deg)
    return np.asarray(upward & rolled & looking_down & high)


def _cosine(angle_deg: float) -> float:
    return math.cos(math.radians(angle_deg))


def _sine(angle_deg: float) -> float:
    return math.sin(math.radians(angle_deg))


def _scaled_heights(
    plane: NDArray[np.float64],
    points: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
) -> NDArray[np.float64]:
    """Height of each point above the plane, in units of tolerance and noise combined."""
    direction = plane * (camera.fx, camera.fy, 1.0)
    height_m = camera.fx * camera.baseline_m / np.linalg.norm(direction, axis=-1)
    expected = plane[..., :2] @ points[:, :2].T + plane[..., 2:]
    # Relative to the plane's own height, each point needs only one division.
    ratio = 1.0 - expected / points[:, 2]
    noise = parameters.disparity_noise_px / points[:, 2]
    tolerance = (parameters.tolerance_m / height_m)[..., np.newaxis]
    return np.asarray(ratio / np.sqrt(tolerance * tolerance + noise * noise))


def _costs(
    planes: NDArray[np.float64],
    points: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
) -> NDArray[np.float64]:
    """Sum the truncated squared residuals of each plane."""
    thin = points[:: max(1, len(points) // parameters.scored_points)]
    heights = _scaled_heights(planes, thin, camera, parameters)
    limit = parameters.max_deviation
    cost = np.minimum(heights**2, limit**2)
    return np.asarray(np.where(heights < -limit, parameters.below_weight * cost, cost).sum(axis=1))


def _reweighted(
    plane: NDArray[np.float64],
    points: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
) -> NDArray[np.float64]:
    """Take one step of least squares, weighted by the residuals of the given plane."""
    heights = _scaled_heights(plane, points, camera, parameters)
    # A disparity residual over d is a height, hence the division. Below one pixel it is limited.
    weight = 1.0 / ((1.0 + heights**2) * np.maximum(points[:, 2], 1.0) ** 2)
    design = np.column_stack((points[:, :2], np.ones(len(points))))
    normal_matrix = design.T @ (design * weight[:, np.newaxis])
    return np.linalg.solve(normal_matrix, design.T @ (weight * points[:, 2]))
