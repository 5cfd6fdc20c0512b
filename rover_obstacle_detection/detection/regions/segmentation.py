"""Mean-shift segmentation into regions (study, section 4.2 step 4; Comaniciu and Meer 2002)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def mean_shift_regions(
    grey: NDArray[np.uint8],
    spatial_radius: float,
    color_radius: float,
    min_region_size: int,
) -> NDArray[np.int32]:
    """Divide the image into connected regions of like grey level.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
    spatial_radius, color_radius : float
        Bandwidths of the mean shift, pixels and grey levels.
    min_region_size : int
        Smaller regions go to the nearest larger one, pixels.

    Returns
    -------
    ndarray of int32, shape (height, width)
        Region of each pixel, 1 to the number of regions: dark pixels have one as well.

    Notes
    -----
    The study thresholds the mean-shift image (Otsu) and so never looks at what is dark. Here two
    neighbours belong together where the filtered levels differ by less than half the bandwidth,
    so that the two modes are one.
    """
    filtered = cv2.pyrMeanShiftFiltering(
        cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), sp=spatial_radius, sr=color_radius
    )
    labels = connected_levels(np.asarray(filtered[..., 0], np.uint8), color_radius / 2)
    return merge_small(labels, min_region_size)


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
    On a grid of twice the size, pixels stand at even places and the links between neighbours
    between them; connected components of that binary picture are those of the graph.
    """
    height, width = image.shape
    levels = image.astype(np.int16)
    links = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    links[::2, ::2] = 1
    links[::2, 1::2] = np.abs(np.diff(levels, axis=1)) <= max_difference
    links[1::2, ::2] = np.abs(np.diff(levels, axis=0)) <= max_difference
    _, labels = cv2.connectedComponents(links, connectivity=4, ltype=cv2.CV_32S)
    return np.ascontiguousarray(labels[::2, ::2], np.int32)


def merge_small(labels: NDArray[np.int32], min_size: int) -> NDArray[np.int32]:
    """Give each region under ``min_size`` pixels to the nearest larger ones, and renumber.

    Parameters
    ----------
    labels : ndarray of int32, shape (height, width)
        1 and up.
    min_size : int

    Returns
    -------
    ndarray of int32, shape (height, width)
        1 to the number of regions kept; all 1 where no region is large enough.
    """
    sizes = np.bincount(labels.ravel())
    large = sizes >= min_size
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
