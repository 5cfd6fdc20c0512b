"""Terrain roughness and elevation step of a sliding window (study, section 4.2 step 6)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera

MIN_WINDOW_POINTS = 3


def window_roughness(
    disparity: NDArray[np.float32], camera: StereoCamera, size: int
) -> NDArray[np.float32]:
    """Mean distance of a window's points from the plane fitted to them.

    Parameters
    ----------
    disparity : ndarray of float32, shape (height, width)
        Pixels, the camera's offset taken off; 0 where there is no match.
    camera : StereoCamera
    size : int
        Side of the window, pixels, odd.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Metres, perpendicular to the plane; NaN where the window has under three points or they
        lie on a line.

    Notes
    -----
    A plane in space, ``n . P = -h``, is a plane in disparity, ``d = a u + b v + c``, and there the
    noise is the same everywhere; so the least-squares fit is made there. A point with disparity d
    at a residual r lies ``h |r| / d`` from the plane, with
    ``h = fx B / |(a fx, b fy, c at the principal point)|``.
    """
    plane, solvable = _fit_window_planes(disparity, size)
    slope_u, slope_v, level = plane
    valid = disparity > 0
    residual = _mean_window_residual(disparity, valid, plane, size)
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


def window_step(elevation_m: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Difference between the highest and the lowest point of a window, along the vertical.

    Parameters
    ----------
    elevation_m : ndarray of float32, shape (height, width)
        Elevation along gravity, metres; NaN where there is no 3D.
    size : int
        Side of the window, pixels, odd.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Metres; NaN where the window has under three points.
    """
    missing = np.isnan(elevation_m)
    kernel = np.ones((size, size), np.uint8)
    highest = cv2.dilate(np.where(missing, -np.inf, elevation_m).astype(np.float32), kernel)
    lowest = cv2.erode(np.where(missing, np.inf, elevation_m).astype(np.float32), kernel)
    count = cv2.boxFilter(
        (~missing).astype(np.float32),
        -1,
        (size, size),
        normalize=False,
        borderType=cv2.BORDER_CONSTANT,
    )
    enough = count > MIN_WINDOW_POINTS - 0.5
    step = np.full(elevation_m.shape, np.nan, np.float32)
    np.subtract(highest, lowest, out=step, where=enough)
    return step


def elevation_along(points: NDArray[np.float32], up: NDArray[np.float32]) -> NDArray[np.float32]:
    """Elevation of each point against gravity, relative to the left eye, metres.

    Parameters
    ----------
    points : ndarray of float32, shape (height, width, 3)
        Left optical frame, metres; NaN where none.
    up : ndarray of float32, shape (3,)
        Unit vector against gravity in the same frame.
    """
    return np.asarray(cv2.transform(points, up.reshape(1, 3)), np.float32)


def _fit_window_planes(
    disparity: NDArray[np.float32], size: int
) -> tuple[tuple[NDArray[np.float64], ...], NDArray[np.bool_]]:
    """Weighted least squares of ``d = a du + b dv + c`` around every pixel, weights 0 or 1."""
    valid = (disparity > 0).astype(np.float64)
    data = disparity.astype(np.float64)
    offsets = np.arange(size, dtype=np.float64) - size // 2
    flat = np.ones(size)

    def moment(image: NDArray[np.float64], u_power: int, v_power: int) -> NDArray[np.float64]:
        u_kernel = offsets**u_power if u_power else flat
        v_kernel = offsets**v_power if v_power else flat
        filtered = cv2.sepFilter2D(
            image, cv2.CV_64F, u_kernel, v_kernel, borderType=cv2.BORDER_CONSTANT
        )
        return np.asarray(filtered, np.float64)

    n, u, v = moment(valid, 0, 0), moment(valid, 1, 0), moment(valid, 0, 1)
    uu, uv, vv = moment(valid, 2, 0), moment(valid, 1, 1), moment(valid, 0, 2)
    d, ud, vd = moment(data, 0, 0), moment(data, 1, 0), moment(data, 0, 1)
    with np.errstate(divide='ignore', invalid='ignore'):
        # Centred on the window's own mean the 3 x 3 system falls to a 2 x 2 one.
        centred_uu, centred_vv = uu - u * u / n, vv - v * v / n
        centred_uv = uv - u * v / n
        centred_ud, centred_vd = ud - u * d / n, vd - v * d / n
        determinant = centred_uu * centred_vv - centred_uv**2
        slope_u = (centred_ud * centred_vv - centred_vd * centred_uv) / determinant
        slope_v = (centred_vd * centred_uu - centred_ud * centred_uv) / determinant
        level = (d - slope_u * u - slope_v * v) / n
    solvable = (n > MIN_WINDOW_POINTS - 0.5) & (determinant > 1e-6)
    plane = tuple(np.where(solvable, part, 0.0) for part in (slope_u, slope_v, level))
    return plane, solvable


def _mean_window_residual(
    disparity: NDArray[np.float32],
    valid: NDArray[np.bool_],
    plane: tuple[NDArray[np.float64], ...],
    size: int,
) -> NDArray[np.float32]:
    half = size // 2
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
