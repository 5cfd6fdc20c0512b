"""2D only: Canny edges around k-means regions (references 3 and 4 of the study)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.detection.study.morphology import close_then_open
from rover_obstacle_detection.evaluation.methods.method import Mask, as_mask

CLUSTERS = 4
# Bilateral filter: diameter (pixels), sigma of grey levels, sigma of distance (pixels).
SMOOTHING = (7, 30, 5)
# Edge of the square in which an edge touches an outline, pixels.
EDGE_ZONE = 5
# Size (pixels) and iterations of the closing and opening.
MORPHOLOGY = (7, 1)
# Pixels that k-means runs on; all of them would take seconds.
SAMPLES = 20000
# Region size as a share of the image: 100 pixels to a tenth of 1024 x 768.
MIN_REGION_SHARE = 0.00013
MAX_REGION_SHARE = 0.1
# Share of a region's outline that must lie on an edge.
MIN_EDGE_SHARE = 0.5


class ImageOnly:
    """Flags regions that differ in grey level from the ground and are bounded by edges.

    K-means clusters the grey levels; the largest cluster is the ground. A connected region of
    another cluster is an obstacle if it is neither tiny nor huge and Canny edges run along at
    least half of its outline.
    """

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Find obstacles in the left image; see `Method`."""
        grey, _ = grey_pair(left, right, camera)
        smooth = np.asarray(cv2.bilateralFilter(grey, *SMOOTHING), np.uint8)
        clusters = cluster_levels(smooth)
        ground = int(np.argmax(np.bincount(clusters.ravel())))
        edges = edge_zone(smooth)
        flagged = np.zeros(camera.shape, bool)
        for cluster in range(CLUSTERS):
            if cluster != ground:
                flagged |= edged_regions(clusters == cluster, edges)
        return close_then_open(as_mask(flagged), *MORPHOLOGY)


def cluster_levels(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Cluster grey levels with k-means; return the cluster number of each pixel."""
    generator = np.random.default_rng(0)
    sample = generator.choice(grey.ravel(), min(SAMPLES, grey.size)).astype(np.float32)
    quantiles = np.quantile(sample, (np.arange(CLUSTERS) + 0.5) / CLUSTERS)
    start = np.abs(sample[:, np.newaxis] - quantiles).argmin(axis=1).astype(np.int32)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 0.1)
    _, _, centres = cv2.kmeans(sample, CLUSTERS, start, criteria, 1, cv2.KMEANS_USE_INITIAL_LABELS)
    levels = np.arange(256, dtype=np.float32)
    nearest = np.abs(levels[:, np.newaxis] - centres.ravel()).argmin(axis=1).astype(np.uint8)
    clusters: NDArray[np.uint8] = nearest[grey]
    return clusters


def edge_zone(grey: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Mark pixels within 2 px of a Canny edge; Otsu sets its thresholds."""
    high, _ = cv2.threshold(grey, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    edges = cv2.Canny(grey, high / 2, high)
    return np.asarray(cv2.dilate(edges, np.ones((EDGE_ZONE, EDGE_ZONE), np.uint8)) != 0)


def edged_regions(area: NDArray[np.bool_], edges: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Keep the connected components of suitable size whose outline lies on edges."""
    binary = area.astype(np.uint8)
    count, numbers, boxes, _ = cv2.connectedComponentsWithStats(binary, connectivity=4)
    inner = cv2.erode(binary, np.ones((3, 3), np.uint8), borderValue=0) != 0
    outline = numbers * (area & ~inner)
    length = np.bincount(outline.ravel(), minlength=count)
    edged = np.bincount(outline[edges], minlength=count)
    share = boxes[:, cv2.CC_STAT_AREA] / area.size
    keep = (share >= MIN_REGION_SHARE) & (share <= MAX_REGION_SHARE)
    keep &= edged >= MIN_EDGE_SHARE * np.maximum(length, 1)
    keep[0] = False
    return np.asarray(keep[numbers])
