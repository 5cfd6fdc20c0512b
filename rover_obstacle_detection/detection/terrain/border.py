"""The left border of the left image, which is not visible in the right image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.components import small_parts
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.terrain import Terrain


def slope_in_border(
    steep: NDArray[np.bool_],
    terrain: Terrain,
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    parameters: TerrainParameters,
) -> NDArray[np.bool_]:
    """Continue slopes into the left border.

    Specks are not continued: slopes are noisy at the edge of the shared view.

    Parameters
    ----------
    steep : ndarray of bool, shape (height, width)
        Pixels of slopes, where they are measured.
    terrain : Terrain
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset.
    camera : StereoCamera
    parameters : TerrainParameters

    Returns
    -------
    ndarray of bool, shape (height, width)
        Pixels without 3D whose nearest measured pixel is on a slope, within reach, and hardly
        inside the right image.
    """
    large = steep & ~small_parts(steep, round(parameters.min_border_slope_share * steep.size))
    reach_px = parameters.border_reach_m * terrain.pixels_per_metre
    return _continued(large, reach_px, terrain, disparity, camera, parameters)


def walls_in_border(
    high: NDArray[np.bool_],
    terrain: Terrain,
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    parameters: TerrainParameters,
) -> NDArray[np.bool_]:
    """Continue what is higher than rocks are into the left border, as far as it is high.

    Parameters
    ----------
    high : ndarray of bool, shape (height, width)
        Pixels of obstacles, where they are measured.
    terrain, disparity, camera, parameters
        See `slope_in_border`.

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    with np.errstate(invalid='ignore'):
        walls = high & (terrain.height_m > parameters.min_wall_m)
        reach_px = terrain.height_m * terrain.pixels_per_metre
    return _continued(walls, reach_px, terrain, disparity, camera, parameters)


def _continued(
    hazard: NDArray[np.bool_],
    reach_px: NDArray[np.float32],
    terrain: Terrain,
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    parameters: TerrainParameters,
) -> NDArray[np.bool_]:
    """Pixels without 3D, outside the right image, whose nearest measured pixel is a hazard."""
    found = np.zeros_like(hazard)
    if not hazard.any():
        return found
    pixels, sources = nearest_measured(terrain.measured, reach_px)
    right_column = pixels % camera.width - disparity.ravel()[sources] - camera.disparity_offset
    continued = hazard.ravel()[sources] & (right_column < parameters.border_px)
    found.ravel()[pixels] = continued
    return found


def nearest_measured(
    measured: NDArray[np.bool_], reach_px: NDArray[np.float32]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the nearest measured pixel of each pixel that is not.

    Parameters
    ----------
    measured : ndarray of bool, shape (height, width)
    reach_px : ndarray of float32, shape (height, width)
        Distance from each measured pixel up to which others may use it.

    Returns
    -------
    pixels : ndarray of int, shape (n,)
        Flat indices of the unmeasured pixels with a measured one in reach.
    sources : ndarray of int, shape (n,)
        Flat indices of their nearest measured pixels.
    """
    missing = np.flatnonzero(~measured)
    if not missing.size or missing.size == measured.size:
        nothing = np.zeros(0, np.intp)
        return nothing, nothing
    distance, labels = cv2.distanceTransformWithLabels(
        (~measured).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    # OpenCV labels the measured pixels from 1, row by row.
    sources = np.flatnonzero(measured)[labels.ravel()[missing] - 1]
    in_reach = distance.ravel()[missing] <= reach_px.ravel()[sources]
    return missing[in_reach], sources[in_reach]
