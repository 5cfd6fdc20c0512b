"""The left border of the left image, which is not visible in the right image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.terrain.parameters import TerrainParameters
from rover_obstacle_detection.detection.terrain.terrain import Terrain


def slope_in_border(
    large: NDArray[np.bool_],
    terrain: Terrain,
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    parameters: TerrainParameters,
) -> NDArray[np.bool_]:
    """Continue slopes into the left border.

    Parameters
    ----------
    large : ndarray of bool, shape (height, width)
        Pixels of large slopes, where they are measured: at the edge of the shared view, noise
        makes specks.
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
    pixels, sources, distance_px = terrain.nearest_measured
    in_reach = distance_px <= reach_px.ravel()[sources]
    pixels, sources = pixels[in_reach], sources[in_reach]
    right_column = pixels % camera.width - disparity.ravel()[sources] - camera.disparity_offset
    continued = hazard.ravel()[sources] & (right_column < parameters.border_px)
    found.ravel()[pixels] = continued
    return found
