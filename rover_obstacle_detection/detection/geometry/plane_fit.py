"""Robust fit of the ground plane in disparity, where stereo noise is uniform."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.parameters import PlaneFitParameters
from rover_obstacle_detection.detection.geometry.robust import quantile


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
        If no plane is found: level ground at the known or default height, not measured. Without
        gravity the camera is assumed level.

    Notes
    -----
    Only the nearer part of the matches counts. The rover stands next to it, so its normal is the
    best estimate of the vertical.
    """
    min_disparity = camera.disparity_at(parameters.max_range_m)
    matched = disparity[disparity > min_disparity]
    if matched.size:
        min_disparity = quantile(matched, 1 - parameters.near_share)
    plane = fit_ground_plane(
        disparity, camera, parameters, min_disparity=min_disparity, gravity=gravity
    )
    if plane is not None:
        return plane.in_space(camera, gravity)
    up = gravity.up if gravity else (0.0, -1.0, 0.0)
    height_m = known_height_m(gravity, parameters) or parameters.default_height_m
    return GroundPlane(up, height_m, up, measured=False)


def known_height_m(gravity: Gravity | None, parameters: PlaneFitParameters) -> float:
    """Return the known height of the camera above the ground, metres; 0 if it is not known."""
    return (gravity.height_m if gravity else None) or parameters.known_height_m


def height_surprise(
    height_m: NDArray[np.float64] | float, known_m: float, parameters: PlaneFitParameters
) -> NDArray[np.float64]:
    """Return how far heights of the camera are from what is expected, standard deviations.

    Parameters
    ----------
    height_m : float or ndarray of float64, shape (n,)
    known_m : float
        The known height; 0 if it is not known.
    parameters : PlaneFitParameters
    """
    spread = parameters.known_height_spread if known_m else parameters.height_spread
    return np.asarray(np.log(height_m / (known_m or parameters.default_height_m)) / spread)


def is_upside_down(
    disparity: NDArray[np.float32], camera: StereoCamera, parameters: PlaneFitParameters
) -> bool:
    """Whether the ground is at the top of the image, and there is none at its bottom.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    camera : StereoCamera
        Of the disparity's size.
    parameters : PlaneFitParameters
    """
    turned = replace(
        camera, cx=camera.width - 1 - camera.cx, cy=camera.height - 1 - camera.cy, cx_right=None
    )
    turned_disparity = np.ascontiguousarray(disparity[::-1, ::-1])
    return estimate_ground(turned_disparity, turned, parameters, None).measured


def fit_ground_plane(
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
    *,
    min_disparity: float,
    gravity: Gravity | None = None,
) -> DisparityPlane | None:
    """Fit the plane that the lowest points of the view lie on.

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
    The rover stands on what is lowest in the view. A wall, a floor below an edge or a slope ahead
    can fill more of it, so a point's weight falls with its height in the image.

    Candidates through three random points are scored by MSAC (Torr and Zisserman 2000) and by
    what is expected of a rover's camera: pitch, roll and height. The seed is fixed, so that a pair
    always gives the same plane. The best candidate is refined by iteratively reweighted least
    squares with Geman and McClure's weights, which ignore what stands far above. Residuals are
    heights, ``h r / d``, over tolerance and noise.
    """
    points = _sample(disparity, camera, min_disparity, parameters.sample_points)
    if len(points) < parameters.min_points:
        return None
    weights = _nearness(points, camera, parameters.nearness_rows, parameters, gravity)
    candidates = _candidates(points, weights, parameters)
    candidates = candidates[_plausible(candidates, camera, parameters, gravity)]
    if not len(candidates):
        return None
    costs = _costs(candidates, points, weights, camera, parameters)
    best = np.argmin(costs + _surprise(candidates, camera, parameters, gravity))
    if costs[best] > parameters.max_cost:
        return None
    plane, residual = candidates[best], float(costs[best])
    weights = _nearness(points, camera, parameters.refined_nearness_rows, parameters, gravity)
    for _ in range(parameters.refinements):
        plane = _reweighted(plane, points, weights, camera, parameters)
    if not _plausible(plane[np.newaxis], camera, parameters, gravity).all():
        # A wall: the best plausible plane only leans on it.
        return None
    slope_u, slope_v, level = (float(value) for value in plane)
    return DisparityPlane(slope_u, slope_v, level, residual)


def _sample(
    disparity: NDArray[np.float32], camera: StereoCamera, min_disparity: float, count: int
) -> NDArray[np.float64]:
    """Rows of (column, row, disparity) relative to the principal point, evenly thinned."""
    rows, columns = np.nonzero(disparity > max(min_disparity, 1e-3))
    thin = max(1, len(rows) // count)
    rows, columns = rows[::thin], columns[::thin]
    return np.column_stack((columns - camera.cx, rows - camera.cy, disparity[rows, columns]))


def _nearness(
    points: NDArray[np.float64],
    camera: StereoCamera,
    nearness_rows: float,
    parameters: PlaneFitParameters,
    gravity: Gravity | None,
) -> NDArray[np.float64]:
    """Weight of each point, falling upwards in the image; their sum is 1."""
    right, down = (-gravity.up[0], -gravity.up[1]) if gravity else (0.0, 1.0)
    length = math.hypot(right, down) + 1e-9
    position = points[:, :2] @ (right / length, down / length)
    lowest = quantile(position, 1 - parameters.lowest_share)
    rise = np.maximum(lowest - position, 0) / camera.height
    weights = np.exp(-rise / nearness_rows)
    return np.asarray(weights / weights.sum())


def _candidates(
    points: NDArray[np.float64], weights: NDArray[np.float64], parameters: PlaneFitParameters
) -> NDArray[np.float64]:
    """Rows of (slope_u, slope_v, level): planes through three points each."""
    generator = np.random.default_rng(0)
    shape = parameters.candidates // 2, 3
    anywhere = generator.integers(len(points), size=shape)
    low = np.searchsorted(np.cumsum(weights), generator.random(shape)).clip(max=len(points) - 1)
    corners = points[np.concatenate((anywhere, low))]
    design = corners.copy()
    design[:, :, 2] = 1.0
    usable = np.abs(np.linalg.det(design)) / 2 > parameters.min_sample_area_px2
    return np.asarray(np.linalg.solve(design[usable], corners[usable][:, :, 2:])[:, :, 0])


def _plausible(
    planes: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
    gravity: Gravity | None,
) -> NDArray[np.bool_]:
    """Select the planes that can be ground."""
    normals, height_m = _in_space(planes, camera)
    near = (height_m > parameters.min_height_m) & (height_m < parameters.max_height_m)
    if gravity is not None:
        upright = normals @ np.asarray(gravity.up) > _cosine(parameters.max_slope_deg)
        return np.asarray(upright & near)
    upward = normals[:, 1] < 0
    rolled = np.abs(normals[:, 0]) < _sine(parameters.max_roll_deg)
    pitched = -normals[:, 2] < _sine(parameters.max_pitch_deg)
    looking_down = normals[:, 2] < _sine(parameters.max_looking_up_deg)
    return np.asarray(upward & rolled & pitched & looking_down & near)


def _in_space(
    planes: NDArray[np.float64], camera: StereoCamera
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Upward unit normals, and distances from the camera in metres."""
    normals = -planes * (camera.fx, camera.fy, 1.0)
    length = np.linalg.norm(normals, axis=1) + 1e-12
    return normals / length[:, np.newaxis], camera.fx * camera.baseline_m / length


def _surprise(
    planes: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
    gravity: Gravity | None,
) -> NDArray[np.float64]:
    """Cost of planes that a rover's camera is seldom mounted over."""
    p = parameters
    normals, height_m = _in_space(planes, camera)
    surprise = height_surprise(height_m, known_height_m(gravity, p), p) ** 2
    if gravity is None:
        pitch_deg = np.degrees(np.arcsin(np.clip(-normals[:, 2], -1, 1)))
        roll_deg = np.degrees(np.arcsin(np.clip(normals[:, 0], -1, 1)))
        surprise += ((pitch_deg - p.usual_pitch_deg) / p.pitch_spread_deg) ** 2
        surprise += (roll_deg / p.roll_spread_deg) ** 2
    return np.asarray(p.surprise_weight * surprise)


def _cosine(angle_deg: float) -> float:
    return math.cos(math.radians(angle_deg))


def _sine(angle_deg: float) -> float:
    return math.sin(math.radians(angle_deg))


def _heights(
    planes: NDArray[Any],
    points: NDArray[Any],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Height of each point above each plane, relative to the camera's height, and its variance.

    Variance comes from tolerance and noise combined.
    """
    height_m = _in_space(planes, camera)[1].astype(planes.dtype)
    inverse = 1 / points[:, 2]
    # Relative to the plane's own height, each point needs only one division.
    design = np.stack((points[:, 0] * inverse, points[:, 1] * inverse, inverse))
    heights = planes @ design
    np.subtract(1, heights, out=heights)
    tolerance = (parameters.tolerance_m / height_m)[:, np.newaxis]
    return heights, np.square(tolerance) + np.square(parameters.disparity_noise_px * inverse)


def _costs(
    planes: NDArray[np.float64],
    points: NDArray[np.float64],
    weights: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
) -> NDArray[np.float64]:
    """Weighted mean of the truncated squared residuals of each plane."""
    thin = slice(None, None, max(1, len(points) // parameters.scored_points))
    weight = (weights[thin] / weights[thin].sum()).astype(np.float32)
    points = points[thin].astype(np.float32)
    most = np.float32(parameters.max_deviation**2)

    def costs(some: NDArray[np.float32]) -> NDArray[np.float32]:
        heights, variance = _heights(some, points, camera, parameters)
        below = heights < 0
        cost = np.square(heights, out=heights)
        cost /= variance
        below &= cost > most
        np.minimum(cost, most, out=cost)
        cost[below] *= np.float32(parameters.below_weight)
        return np.asarray(cost @ weight)

    # A few at a time, for the cache.
    parts = np.array_split(planes.astype(np.float32), max(1, len(planes) // 50))
    return np.concatenate([costs(some) for some in parts])


def _reweighted(
    plane: NDArray[np.float64],
    points: NDArray[np.float64],
    weights: NDArray[np.float64],
    camera: StereoCamera,
    parameters: PlaneFitParameters,
) -> NDArray[np.float64]:
    """Take one step of least squares, weighted by the residuals of the given plane."""
    (heights,), (variance,) = _heights(plane[np.newaxis], points, camera, parameters)
    # In disparity, relief shrinks with the square of the distance.
    weight = weights / (np.square(1 + np.square(heights) / variance) * variance)
    weight /= np.square(points[:, 2])
    design = np.column_stack((points[:, :2], np.ones(len(points))))
    normal_matrix = design.T @ (design * weight[:, np.newaxis])
    return np.linalg.solve(normal_matrix, design.T @ (weight * points[:, 2]))
