"""Roughness and elevation step in a sliding window (study, section 4.2 step 6)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.geometry.moments import Moments, planes_from_moments

MIN_WINDOW_POINTS = 3
"""Fewest points of a window with an elevation step."""

MIN_SPREAD_PX4 = 1e-6
"""Determinant of a window's scatter below which its points, or fewer than three, lie on a line."""


def window_roughness(
    disparity: NDArray[np.float32], camera: StereoCamera, size_px: int
) -> NDArray[np.float32]:
    """Compute the mean distance of a window's points from the plane fitted to them.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset; 0 where there is no match.
    camera : StereoCamera
    size_px : int
        Side of the window, odd.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Metres, perpendicular to the plane; NaN if the window has under three points or they are
        collinear.

    Notes
    -----
    A plane in space, ``n . P = -h``, is a plane in disparity, ``d = a u + b v + c``. Noise is
    uniform there, so the least-squares fit is made in disparity. A point with disparity d and
    residual r lies ``h |r| / d`` from the plane, with
    ``h = fx B / |(a fx, b fy, c at the principal point)|``.
    """
    plane, solvable = _fit_window_planes(disparity, size_px)
    slope_u, slope_v, level = plane
    residual = _mean_window_residual(disparity, plane, size_px)
    rows = np.arange(camera.height, dtype=np.float32)[:, np.newaxis] - np.float32(camera.cy)
    columns = np.arange(camera.width, dtype=np.float32)[np.newaxis] - np.float32(camera.cx)
    at_principal_point = level - slope_u * columns - slope_v * rows
    normal_length = np.sqrt(
        (slope_u * camera.fx) ** 2 + (slope_v * camera.fy) ** 2 + at_principal_point**2
    )
    with np.errstate(divide='ignore', invalid='ignore'):
        plane_distance_m = np.float32(camera.fx * camera.baseline_m) / normal_length
        roughness = residual * plane_distance_m / level
    roughness[~solvable | (level <= 0)] = np.nan
    return roughness.astype(np.float32)


def window_step(elevation_m: NDArray[np.float32], size_px: int) -> NDArray[np.float32]:
    """Compute the elevation difference between the highest and lowest point of a window.

    Parameters
    ----------
    elevation_m : ndarray of float32, shape (height, width)
        Elevation along gravity, metres; NaN where there is no 3D.
    size_px : int
        Side of the window, odd.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Metres; NaN if the window has under three points.
    """
    missing = np.isnan(elevation_m)
    kernel = np.ones((size_px, size_px), np.uint8)
    highest = cv2.dilate(np.where(missing, -np.inf, elevation_m).astype(np.float32), kernel)
    lowest = cv2.erode(np.where(missing, np.inf, elevation_m).astype(np.float32), kernel)
    count = cv2.boxFilter(
        (~missing).astype(np.float32),
        -1,
        (size_px, size_px),
        normalize=False,
        borderType=cv2.BORDER_CONSTANT,
    )
    enough = count >= MIN_WINDOW_POINTS
    step = np.full(elevation_m.shape, np.nan, np.float32)
    np.subtract(highest, lowest, out=step, where=enough)
    return step


def elevation_along(points: NDArray[np.float32], up: NDArray[np.float32]) -> NDArray[np.float32]:
    """Compute the elevation of each point relative to the left camera, metres.

    Parameters
    ----------
    points : ndarray of float32, shape (height, width, 3)
        Left optical frame, metres; NaN where there is none.
    up : ndarray of float32, shape (3,)
        Unit vector against gravity in the same frame.

    Returns
    -------
    ndarray of float32, shape (height, width)
    """
    return np.asarray(cv2.transform(points, up.reshape(1, 3)), np.float32)


def _fit_window_planes(
    disparity: NDArray[np.float32], size_px: int
) -> tuple[tuple[NDArray[np.float64], ...], NDArray[np.bool_]]:
    """Fit ``d = a du + b dv + c`` around every pixel, and report where there is a solution."""
    valid = (disparity > 0).astype(np.float64)
    data = disparity.astype(np.float64)
    moments = Moments(
        n=_moment(valid, size_px, 0, 0),
        u=_moment(valid, size_px, 1, 0),
        v=_moment(valid, size_px, 0, 1),
        uu=_moment(valid, size_px, 2, 0),
        uv=_moment(valid, size_px, 1, 1),
        vv=_moment(valid, size_px, 0, 2),
        h=_moment(data, size_px, 0, 0),
        uh=_moment(data, size_px, 1, 0),
        vh=_moment(data, size_px, 0, 1),
    )
    fitted = planes_from_moments(moments)
    solvable = fitted.determinant * moments.n**2 > MIN_SPREAD_PX4
    parts = fitted.rise_u, fitted.rise_v, fitted.height
    return tuple(np.where(solvable, part, 0.0) for part in parts), solvable


def _moment(
    image: NDArray[np.float64], size_px: int, u_power: int, v_power: int
) -> NDArray[np.float64]:
    """Sum ``image du**u_power dv**v_power`` over the window around every pixel."""
    offsets = np.arange(size_px, dtype=np.float64) - size_px // 2
    filtered = cv2.sepFilter2D(
        image, cv2.CV_64F, offsets**u_power, offsets**v_power, borderType=cv2.BORDER_CONSTANT
    )
    return np.asarray(filtered, np.float64)


def _mean_window_residual(
    disparity: NDArray[np.float32], plane: tuple[NDArray[np.float64], ...], size_px: int
) -> NDArray[np.float32]:
    """Average the magnitude of the residuals of each window's own plane."""
    half = size_px // 2
    slope_u, slope_v, level = (part.astype(np.float32) for part in plane)
    padded = cv2.copyMakeBorder(disparity, half, half, half, half, cv2.BORDER_CONSTANT, value=0)
    height, width = disparity.shape
    total = np.zeros_like(disparity)
    count = np.zeros_like(disparity)
    for dv in range(-half, half + 1):
        for du in range(-half, half + 1):
            shifted = padded[half + dv : half + dv + height, half + du : half + du + width]
            present = shifted > 0
            total += np.where(present, np.abs(shifted - (level + slope_u * du + slope_v * dv)), 0)
            count += present
    return np.asarray(total / np.maximum(count, 1), np.float32)
