"""Planes fitted around every cell of a map, with Gaussian weights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.moments import (
    MIN_WEIGHT,
    Moments,
    planes_from_moments,
)
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters

Grid = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LocalPlanes:
    """The plane around each cell of a map, by weighted least squares.

    Parameters
    ----------
    height : ndarray of float32, shape (rows, columns)
        Of the plane at the cell, in the unit of the given heights.
    rise_along_columns, rise_along_rows : ndarray of float32, shape (rows, columns)
        Change of height from one column, or row, to the next.
    weight : ndarray of float32, shape (rows, columns)
        Gaussian sum of the weights around the cell.
    spread : ndarray of float32, shape (rows, columns)
        Standard deviation of the weighted cells in the direction in which they spread least,
        cells: 0 where they lie on a line, which leaves the rise across it open.
    """

    height: Grid
    rise_along_columns: Grid
    rise_along_rows: Grid
    weight: Grid
    spread: Grid


def local_planes(
    height: Grid, weight: Grid, sigma_cells: float, ridge: float, parameters: TerrainParameters
) -> LocalPlanes:
    """Fit a plane around each cell, with Gaussian weights.

    Parameters
    ----------
    height : ndarray of float32, shape (rows, columns)
    weight : ndarray of float32, shape (rows, columns)
        Trust in each cell; 0 where it is empty.
    sigma_cells : float
        Standard deviation of the Gaussian, cells.
    ridge : float
        Regularisation where cells lie on a line: a share of the Gaussian's variance.
    parameters : TerrainParameters

    Notes
    -----
    Local linear regression (Fan and Gijbels 1996). Where all cells have the same weight, its rise
    equals that of the Gaussian-smoothed map. Unlike smoothing, it is unbiased at the edge of the
    visible ground. A wide Gaussian runs on a coarser grid.
    """
    reach = parameters.reach_sigmas
    moment = weight * height
    small = _coarser(height.shape, sigma_cells, parameters)
    if small is None:
        return _planes(moment, weight, sigma_cells, ridge, reach)
    rows, columns = height.shape
    mass, moment = (_averaged(grid, small) for grid in (weight, moment))
    coarse_columns, coarse_rows = columns / small[0], rows / small[1]
    planes = _planes(moment, mass, sigma_cells / coarse_columns, ridge, reach)

    def finer(grid: Grid, scale: float = 1.0) -> Grid:
        wide = cv2.resize(grid, (columns, rows), interpolation=cv2.INTER_LINEAR)
        return np.asarray(wide * np.float32(scale), np.float32)

    return LocalPlanes(
        height=finer(planes.height),
        rise_along_columns=finer(planes.rise_along_columns, 1 / coarse_columns),
        rise_along_rows=finer(planes.rise_along_rows, 1 / coarse_rows),
        weight=finer(planes.weight, coarse_columns * coarse_rows),
        spread=finer(planes.spread, min(coarse_columns, coarse_rows)),
    )


def gaussian_sum(grid: Grid, sigma_cells: float, parameters: TerrainParameters) -> Grid:
    """Sum the cells around each, with the Gaussian weights of `local_planes`.

    Parameters
    ----------
    grid : ndarray of float32, shape (rows, columns)
    sigma_cells : float
        Standard deviation of the Gaussian, cells.
    parameters : TerrainParameters

    Returns
    -------
    ndarray of float32, shape (rows, columns)
    """
    reach = parameters.reach_sigmas
    small = _coarser(grid.shape, sigma_cells, parameters)
    if small is None:
        return _blurred(grid, sigma_cells, reach)
    rows, columns = grid.shape
    coarse_columns, coarse_rows = columns / small[0], rows / small[1]
    total = _blurred(_averaged(grid, small), sigma_cells / coarse_columns, reach)
    wide = cv2.resize(total, (columns, rows), interpolation=cv2.INTER_LINEAR)
    return np.asarray(wide * np.float32(coarse_columns * coarse_rows), np.float32)


def _coarser(
    shape: tuple[int, ...], sigma_cells: float, parameters: TerrainParameters
) -> tuple[int, int] | None:
    """Columns and rows of the coarser grid for a wide Gaussian; None if it is not wide."""
    reduction = max(1, math.floor(sigma_cells / parameters.cells_per_sigma))
    if reduction == 1:
        return None
    return max(1, shape[1] // reduction), max(1, shape[0] // reduction)


def _averaged(grid: Grid, size: tuple[int, int]) -> Grid:
    return np.asarray(cv2.resize(grid, size, interpolation=cv2.INTER_AREA), np.float32)


def _planes(moment: Grid, mass: Grid, sigma: float, ridge: float, reach: float) -> LocalPlanes:
    def blurred(image: Grid, u_power: int, v_power: int) -> Grid:
        return _blurred(image, sigma, reach, u_power, v_power)

    moments = Moments(
        n=blurred(mass, 0, 0),
        u=blurred(mass, 1, 0),
        v=blurred(mass, 0, 1),
        uu=blurred(mass, 2, 0),
        uv=blurred(mass, 1, 1),
        vv=blurred(mass, 0, 2),
        h=blurred(moment, 0, 0),
        uh=blurred(moment, 1, 0),
        vh=blurred(moment, 0, 1),
    )
    added = np.float32(ridge * sigma**2)
    fitted = planes_from_moments(moments, float(added))
    half = (fitted.variance_u + fitted.variance_v) / 2
    difference = (fitted.variance_u - fitted.variance_v) / 2
    spread = np.sqrt(difference * difference + fitted.covariance * fitted.covariance)
    least = np.maximum(half - spread - added, 0)
    return LocalPlanes(
        fitted.height,
        fitted.rise_u,
        fitted.rise_v,
        np.maximum(moments.n, MIN_WEIGHT),
        np.asarray(np.sqrt(least), np.float32),
    )


def _blurred(image: Grid, sigma: float, reach: float, u_power: int = 0, v_power: int = 0) -> Grid:
    radius = max(1, math.ceil(reach * sigma))
    offsets = np.arange(-radius, radius + 1, dtype=np.float32)
    bell = np.exp(-0.5 * (offsets / np.float32(sigma)) ** 2)
    return np.asarray(
        cv2.sepFilter2D(
            image, cv2.CV_32F, bell * offsets**u_power, bell * offsets**v_power,
            borderType=cv2.BORDER_CONSTANT,
        ),
        np.float32,
    )  # fmt: skip
