"""Mean-shift segmentation (study, section 4.2 step 4; Comaniciu and Meer 2002)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.images.parameters import ImageParameters
from rover_obstacle_detection.detection.images.texture import texture_level
from rover_obstacle_detection.detection.regions.parameters import RegionParameters


def reduced_regions(
    grey: NDArray[np.uint8], parameters: RegionParameters, images: ImageParameters
) -> NDArray[np.int32]:
    """Segment the reduced image, with a grey-level bandwidth that follows its texture.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    parameters : RegionParameters
    images : ImageParameters

    Returns
    -------
    ndarray of int32, shape (height, width)
        Region of each pixel, 1 and up.
    """
    reduction, radius = parameters.reduction, parameters.mean_shift_color_radius
    size = max(1, grey.shape[1] // reduction), max(1, grey.shape[0] // reduction)
    small = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.uint8)
    bandwidth = np.clip(
        parameters.bandwidth_per_texture * texture_level(small, images),
        parameters.min_bandwidth_ratio * radius,
        parameters.max_bandwidth_ratio * radius,
    )
    regions = mean_shift_regions(
        small,
        max(1.0, parameters.mean_shift_spatial_radius_px / reduction),
        float(bandwidth),
        max(1, parameters.min_region_size_px // reduction**2),
    )
    return np.asarray(
        cv2.resize(regions, grey.shape[::-1], interpolation=cv2.INTER_NEAREST), np.int32
    )


def mean_shift_regions(
    grey: NDArray[np.uint8],
    spatial_radius_px: float,
    color_radius: float,
    min_size_px: int,
) -> NDArray[np.int32]:
    """Divide the image into connected regions of similar grey level.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    spatial_radius_px, color_radius : float
        Bandwidths of the mean shift, pixels and grey levels.
    min_size_px : int
        Smaller regions are merged into the nearest larger one, pixels of area.

    Returns
    -------
    ndarray of int32, shape (height, width)
        Region of each pixel, 1 to the number of regions.

    Notes
    -----
    The study thresholds the mean-shift image (Otsu) and so ignores everything dark. Here two
    neighbours belong together if their filtered levels differ by at most half the bandwidth: then
    their modes are one.
    """
    filtered = cv2.pyrMeanShiftFiltering(
        cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), sp=spatial_radius_px, sr=color_radius
    )
    labels = connected_levels(np.asarray(filtered[..., 0], np.uint8), color_radius / 2)
    return merge_small(labels, min_size_px)


def connected_levels(image: NDArray[np.uint8], max_difference: float) -> NDArray[np.int32]:
    """Label the 4-connected regions in which neighbours differ by at most ``max_difference``.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
    max_difference : float

    Returns
    -------
    ndarray of int32, shape (height, width)
        1 to the number of regions.

    Notes
    -----
    A binary image of twice the size has the pixels at even places and the links between
    neighbours in between. Its connected components are the regions.
    """
    height, width = image.shape
    levels = image.astype(np.int16)
    links = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    links[::2, ::2] = 1
    links[::2, 1::2] = np.abs(np.diff(levels, axis=1)) <= max_difference
    links[1::2, ::2] = np.abs(np.diff(levels, axis=0)) <= max_difference
    _, labels = cv2.connectedComponents(links, connectivity=4, ltype=cv2.CV_32S)
    return np.ascontiguousarray(labels[::2, ::2], np.int32)


def merge_small(labels: NDArray[np.int32], min_size_px: int) -> NDArray[np.int32]:
    """Merge small regions into the nearest larger ones, and renumber.

    Parameters
    ----------
    labels : ndarray of int32, shape (height, width)
        1 and up.
    min_size_px : int
        Fewest pixels of a region that stays.

    Returns
    -------
    ndarray of int32, shape (height, width)
        1 to the number of regions; all 1 if no region is large enough.
    """
    sizes = np.bincount(labels.ravel())
    large = sizes >= min_size_px
    large[0] = False
    if not large.any():
        return np.ones_like(labels)
    numbers = np.where(large, np.cumsum(large), 0).astype(np.int32)
    renumbered = numbers[labels]
    small = (renumbered == 0).astype(np.uint8)
    if not small.any():
        return renumbered
    _, nearest = cv2.distanceTransformWithLabels(
        small, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    owner = np.zeros(int(nearest.max()) + 1, np.int32)
    kept = small == 0
    owner[nearest[kept]] = renumbered[kept]
    return owner[nearest]
