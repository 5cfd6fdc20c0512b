"""The ground plane, fitted where stereo noise is uniform: in disparity."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.gravity import Gravity
from rover_obstacle_detection.detection.geometry.ground_plane import DisparityPlane, GroundPlane
from rover_obstacle_detection.detection.geometry.noise import DISPARITY_NOISE_PX

NEAR_SHARE = 0.7

_CANDIDATES = 200
_SAMPLE_SIZE = 2000
_REFINEMENTS = 6
_MAX_TILT_DEG = 60.0
_BELOW_WEIGHT = 2.0
_MIN_HEIGHT_M = 0.05


def fit_ground_plane(
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    *,
    tolerance_m: float,
    noise_px: float,
    min_disparity: float,
    gravity: Gravity | None = None,
) -> DisparityPlane | None:
    """Find the plane that carries most of what is seen and has little below it.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    camera : StereoCamera
        Of the disparity's size.
    tolerance_m : float
        Relief that still counts as ground, metres.
    noise_px : float
        Standard deviation of the disparity, pixels.
    min_disparity : float
        Farther points are left out, pixels.
    gravity : Gravity, optional
        The vertical, where known: the ground lies within 30 degrees of it.

    Returns
    -------
    DisparityPlane or None
        None where too little is matched, or nothing that could be ground.

    Notes
    -----
    Candidates through three random points (a fixed seed: the same pair gives the same plane) are
    scored by MSAC (Torr and Zisserman 2000) with a point below the plane weighing double: ground
    has obstacles on it, but nothing under it. The best is refined by iteratively reweighted
    least squares with Cauchy weights. Residuals are heights, ``h r / d``, over their own noise.
    """
    points = _sample(disparity, camera, min_disparity)
    if len(points) < 50:
        return None
    candidates = _candidates(points, camera, gravity)
    if not len(candidates):
        return None
    best = candidates[np.argmin(_costs(candidates, points, camera, tolerance_m, noise_px))]
    for _ in range(_REFINEMENTS):
        refined = _reweighted(best, points, camera, tolerance_m, noise_px)
        if not _plausible(refined[np.newaxis], camera, gravity).all():
            break
        best = refined
    return DisparityPlane(*(float(value) for value in best))


def _sample(
    disparity: NDArray[np.float32], camera: StereoCamera, min_disparity: float
) -> NDArray[np.float64]:
    """Rows of (column, row, disparity) relative to the principal point, evenly thinned."""
    rows, columns = np.nonzero(disparity > max(min_disparity, 1e-3))
    thin = max(1, len(rows) // _SAMPLE_SIZE)
    rows, columns = rows[::thin], columns[::thin]
    return np.column_stack((columns - camera.cx, rows - camera.cy, disparity[rows, columns]))


def _candidates(
    points: NDArray[np.float64], camera: StereoCamera, gravity: Gravity | None
) -> NDArray[np.float64]:
    generator = np.random.default_rng(0)
    triples = generator.integers(len(points), size=(_CANDIDATES, 3))
    corners = points[triples]
    design = corners.copy()
    design[:, :, 2] = 1.0
    usable = np.abs(np.linalg.det(design)) > 1.0
    planes = np.linalg.solve(design[usable], corners[usable][:, :, 2:])[:, :, 0]
    return planes[_plausible(planes, camera, gravity)]


def _plausible(
    planes: NDArray[np.float64], camera: StereoCamera, gravity: Gravity | None
) -> NDArray[np.bool_]:
    normals = -planes * (camera.fx, camera.fy, 1.0)
    length = np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    normals /= length
    high = camera.fx * camera.baseline_m / length[:, 0] > _MIN_HEIGHT_M
    if gravity is not None:
        upright = normals @ np.asarray(gravity.up) > math.cos(math.radians(30.0))
        return np.asarray(upright & high)
    # Without gravity: upright within a camera that looks up to 80 degrees down, little roll.
    upward = -normals[:, 1] > math.cos(math.radians(80.0))
    rolled = np.abs(normals[:, 0]) < math.sin(math.radians(_MAX_TILT_DEG / 2))
    looking_down = normals[:, 2] < math.sin(math.radians(_MAX_TILT_DEG / 2))
    return np.asarray(upward & rolled & looking_down & high)


def _scaled_heights(
    plane: NDArray[np.float64],
    points: NDArray[np.float64],
    camera: StereoCamera,
    tolerance_m: float,
    noise_px: float,
) -> NDArray[np.float64]:
    """Height of each point over the plane, in units of tolerance and noise together."""
    direction = plane * (camera.fx, camera.fy, 1.0)
    height_m = camera.fx * camera.baseline_m / np.linalg.norm(direction, axis=-1)
    expected = plane[..., :2] @ points[:, :2].T + plane[..., 2:]
    # With everything over the plane's own height there is one division per point left.
    ratio = 1.0 - expected / points[:, 2]
    noise = noise_px / points[:, 2]
    tolerance = (tolerance_m / height_m)[..., np.newaxis]
    return np.asarray(ratio / np.sqrt(tolerance * tolerance + noise * noise))


def _costs(
    planes: NDArray[np.float64],
    points: NDArray[np.float64],
    camera: StereoCamera,
    tolerance_m: float,
    noise_px: float,
) -> NDArray[np.float64]:
    thin = points[:: max(1, len(points) // 400)]
    heights = _scaled_heights(planes, thin, camera, tolerance_m, noise_px)
    cost = np.minimum(heights**2, 9.0)
    return np.asarray(np.where(heights < -3.0, _BELOW_WEIGHT * cost, cost).sum(axis=1))


def _reweighted(
    plane: NDArray[np.float64],
    points: NDArray[np.float64],
    camera: StereoCamera,
    tolerance_m: float,
    noise_px: float,
) -> NDArray[np.float64]:
    heights = _scaled_heights(plane, points, camera, tolerance_m, noise_px)
    # Least squares of the disparity residual; over d it becomes height, hence the division.
    weight = 1.0 / ((1.0 + heights**2) * np.maximum(points[:, 2], 1.0) ** 2)
    design = np.column_stack((points[:, :2], np.ones(len(points))))
    normal_matrix = design.T @ (design * weight[:, np.newaxis])
    return np.linalg.solve(normal_matrix, design.T @ (weight * points[:, 2]))


def estimate_ground(
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    config: DetectorConfig,
    gravity: Gravity | None,
) -> GroundPlane:
    """Find the ground in view, or what the known mounting says where too little is seen.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    camera : StereoCamera
        Of the disparity's size.
    config : DetectorConfig
    gravity : Gravity, optional

    Returns
    -------
    GroundPlane
        With a height of 1 m below a level camera where nothing at all is known.

    Notes
    -----
    The plane follows the nearer part of what is seen: the rover stands next to that, so its
    normal is the best guess at the vertical where nobody tells it.
    """
    farthest = camera.disparity_at(config.max_range)
    seen = disparity[disparity > farthest]
    plane = fit_ground_plane(
        disparity,
        camera,
        tolerance_m=config.max_step / 2,
        noise_px=DISPARITY_NOISE_PX,
        min_disparity=float(np.quantile(seen, 1 - NEAR_SHARE)) if seen.size else farthest,
        gravity=gravity,
    )
    if plane is not None:
        return plane.in_space(camera, gravity)
    up = gravity.up if gravity else (0.0, -1.0, 0.0)
    height_m = (gravity.height_m if gravity else None) or 1.0
    return GroundPlane(normal=up, height_m=height_m, up=up)
