"""Obstacle pixels that nothing but their neighbourhood shows, as they have no 3D."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.components import small_parts
from rover_obstacle_detection.detection.regions.grey_level import dark_regions
from rover_obstacle_detection.detection.regions.parameters import RegionParameters
from rover_obstacle_detection.detection.regions.regions import Nearest, carried


def slope_beyond_border(
    steep: NDArray[np.bool_],
    nearest: Nearest,
    disparity: NDArray[np.float32],
    camera: StereoCamera,
    parameters: RegionParameters,
) -> NDArray[np.bool_]:
    """Continue slopes into the left border, which is not visible in the right image.

    Parameters
    ----------
    steep : ndarray of bool, shape (height, width)
        Pixels of slopes, where they are measured.
    nearest : Nearest
        Nearest measured pixels of the others.
    disparity : ndarray of float32, shape (height, width)
        Pixels, without the camera's offset.
    camera : StereoCamera
    parameters : RegionParameters

    Returns
    -------
    ndarray of bool, shape (height, width)

    Notes
    -----
    Specks are not continued: slopes are noisy at the edge of the shared view.
    """
    if not steep.any():
        return np.zeros_like(steep)
    large = steep & ~small_parts(steep, round(parameters.speck_share * steep.size))
    found = carried(large, nearest)
    right_column = nearest.pixels % camera.width - disparity.ravel()[nearest.sources]
    found.ravel()[nearest.pixels] &= right_column - camera.disparity_offset < parameters.border_px
    return found


def rocks_in_regions(
    high: NDArray[np.bool_],
    rock_probability: NDArray[np.float32],
    unmatched: NDArray[np.bool_],
    nearest: Nearest,
    regions: NDArray[np.int32],
    is_seed: NDArray[np.bool_],
    parameters: RegionParameters,
) -> NDArray[np.bool_]:
    """Continue rocks over the unmatched pixels of their region.

    Parameters
    ----------
    high : ndarray of bool, shape (height, width)
        Pixels of rocks.
    rock_probability : ndarray of float32, shape (height, width)
        Result of the outline filter; NaN where it was not applied.
    unmatched : ndarray of bool, shape (height, width)
        Pixels without disparity.
    nearest : Nearest
        Nearest measured pixels of the others.
    regions : ndarray of int32, shape (height, width)
        1 and up.
    is_seed : ndarray of bool, shape (regions + 1,)
        Regions with enough 3D points.
    parameters : RegionParameters

    Returns
    -------
    ndarray of bool, shape (height, width)
        Unmatched pixels of seed regions whose nearest measured pixel is on a rock of the same
        region, unless the outline filter denies it.
    """
    near_rock = np.zeros_like(high)
    denied = rock_probability < parameters.min_rock_probability
    beside = carried(high, nearest, regions) & ~denied
    near_rock[unmatched] = beside[unmatched] & is_seed[regions[unmatched]]
    return near_rock


def dark_without_3d(
    grey: NDArray[np.uint8],
    expected: NDArray[np.float32],
    unmatched: NDArray[np.bool_],
    regions: NDArray[np.int32],
    is_seed: NDArray[np.bool_],
    camera: StereoCamera,
    parameters: RegionParameters,
) -> NDArray[np.bool_]:
    """Find dark regions without 3D, though they should be visible in the right image.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        Left image.
    expected : ndarray of float32, shape (height, width)
        Disparity of the ground plane, pixels.
    unmatched : ndarray of bool, shape (height, width)
        Pixels without disparity.
    regions : ndarray of int32, shape (height, width)
        1 and up.
    is_seed : ndarray of bool, shape (regions + 1,)
        Regions with enough 3D points.
    camera : StereoCamera
    parameters : RegionParameters

    Returns
    -------
    ndarray of bool, shape (height, width)
        Unmatched pixels of dark regions at which the ground plane lies within range and in the
        right image.
    """
    dark = np.zeros_like(unmatched)
    is_dark = dark_regions(grey, regions, is_seed, parameters.dark_grey_level)
    if not is_dark.any():
        return dark
    ground = expected[unmatched]
    right_column = np.nonzero(unmatched)[1] - ground - camera.disparity_offset
    shared_view = (right_column >= 0) & (right_column <= camera.width - 1)
    shared_view &= ground > camera.disparity_at(parameters.max_range_m)
    dark[unmatched] = is_dark[regions[unmatched]] & shared_view
    return dark
