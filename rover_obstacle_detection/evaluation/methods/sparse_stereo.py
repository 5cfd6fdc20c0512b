"""Sparse stereo after Wang et al.: interest points, correlation, RANSAC, guided matching."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera

Points = NDArray[np.intp]
Matches = NDArray[np.float64]

# Förstner operator: window (pixels), and its usual thresholds on roundness and relative weight.
FOERSTNER_WINDOW = 7
MIN_ROUNDNESS = 0.5
MIN_WEIGHT_OF_MEAN = 0.5
# Least distance of interest points, pixels.
SPACING = 7
# Edge of the correlated patches, pixels, and the least correlation of a match.
PATCH = 11
MIN_CORRELATION = 0.8
MIN_GUIDED_CORRELATION = 0.7
# Largest row difference of a match, and distance from the epipolar line, pixels.
ROW_TOLERANCE = 1
RANSAC_PX = 1.0
RANSAC_CONFIDENCE = 0.99
# Guided matching searches this far around the predicted disparity, pixels.
SEARCH = 3
# Points that the fundamental matrix needs.
MIN_MATCHES = 8


def foerstner_points(grey: NDArray[np.uint8]) -> Points:
    """Find interest points (Förstner and Gülch 1987).

    Returns
    -------
    ndarray of int, shape (n, 2)
        Row and column, sorted by row.

    Notes
    -----
    From the eigenvalues of the structure tensor, the weight is ``w = l1 l2 / (l1 + l2)`` and the
    roundness ``q = 4 l1 l2 / (l1 + l2)^2``. A point is a local maximum of w with w above half its
    mean and q above 0.5.
    """
    eigen = cv2.cornerEigenValsAndVecs(grey, FOERSTNER_WINDOW, 3)
    product = eigen[..., 0] * eigen[..., 1]
    total = np.maximum(eigen[..., 0] + eigen[..., 1], 1e-12)
    weight = product / total
    peak = weight == cv2.dilate(weight, np.ones((SPACING, SPACING), np.uint8))
    peak &= weight > MIN_WEIGHT_OF_MEAN * weight.mean()
    peak &= 4 * product / total**2 > MIN_ROUNDNESS
    half = PATCH // 2
    inside = np.zeros_like(peak)
    inside[half:-half, half:-half] = True
    return np.argwhere(peak & inside)


def correlate_points(
    left: NDArray[np.uint8], right: NDArray[np.uint8], camera: StereoCamera, min_depth_m: float
) -> Matches:
    """Match interest points of both images by normalised correlation, with a left-right check.

    Returns
    -------
    ndarray of float, shape (n, 4)
        Column and row in the left image, column and row in the right image.
    """
    points_left, points_right = foerstner_points(left), foerstner_points(right)
    furthest = camera.disparity_at(min_depth_m) + camera.disparity_offset
    first, second = _candidate_pairs(points_left, points_right, camera, furthest)
    patches_left = _normalised_patches(left, points_left)
    patches_right = _normalised_patches(right, points_right)
    correlation = np.einsum('ij,ij->i', patches_left[first], patches_right[second])
    order = np.argsort(-correlation, kind='stable')
    order = order[correlation[order] >= MIN_CORRELATION]
    # In order of correlation, the first match of each point is its best.
    best_of_left = np.zeros(len(order), bool)
    best_of_left[np.unique(first[order], return_index=True)[1]] = True
    best_of_right = np.zeros(len(order), bool)
    best_of_right[np.unique(second[order], return_index=True)[1]] = True
    chosen = order[best_of_left & best_of_right]
    return np.hstack(
        (points_left[first[chosen]][:, ::-1], points_right[second[chosen]][:, ::-1])
    ).astype(np.float64)


def without_outliers(matches: Matches) -> Matches:
    """Drop matches that violate the epipolar geometry estimated by RANSAC."""
    if len(matches) < MIN_MATCHES:
        return matches[:0]
    _, inliers = cv2.findFundamentalMat(
        matches[:, :2], matches[:, 2:], cv2.FM_RANSAC, RANSAC_PX, RANSAC_CONFIDENCE
    )
    if inliers is None:
        return matches[:0]
    kept: Matches = matches[inliers.ravel() != 0]
    return kept


def guided_disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    camera: StereoCamera,
    matches: Matches,
) -> NDArray[np.float32]:
    """Match every pixel near the disparity predicted by a mesh of the matched points.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Pixels, without the camera's disparity offset, interpolated by a parabola; 0 where the
        correlation is low or the mesh ends.
    """
    predicted = _predict(matches, camera)
    rows, columns = np.indices(camera.shape, np.float32)
    scores = np.stack(
        [
            _correlation(
                left,
                np.asarray(
                    cv2.remap(right, columns - predicted - offset, rows, cv2.INTER_LINEAR),
                    np.uint8,
                ),
            )
            for offset in range(-SEARCH, SEARCH + 1)
        ]
    )
    best = scores[1:-1].argmax(axis=0)[np.newaxis] + 1
    before, peak, after = (np.take_along_axis(scores, best + step, 0)[0] for step in (-1, 0, 1))
    curvature = before - 2 * peak + after
    is_peak = (curvature < 0) & (peak >= before) & (peak >= after)
    shift = 0.5 * (before - after) / np.where(curvature < 0, curvature, -1)
    disparity = predicted + (best[0] - SEARCH) + shift - np.float32(camera.disparity_offset)
    reliable = is_peak & (peak >= MIN_GUIDED_CORRELATION) & np.isfinite(predicted)
    return np.where(reliable & (disparity > 0), disparity, 0).astype(np.float32)


def _candidate_pairs(
    points_left: Points, points_right: Points, camera: StereoCamera, furthest: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Index pairs on nearly the same row within the disparity range."""
    keys = points_right[:, 0] * camera.width + points_right[:, 1]
    first, second = [], []
    for row_step in range(-ROW_TOLERANCE, ROW_TOLERANCE + 1):
        row = (points_left[:, 0] + row_step) * camera.width
        nearest = np.maximum(points_left[:, 1] - int(np.ceil(furthest)), 0)
        start = np.searchsorted(keys, row + nearest)
        stop = np.searchsorted(keys, row + points_left[:, 1], side='right')
        count = np.maximum(stop - start, 0)
        owner = np.repeat(np.arange(len(points_left)), count)
        within = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        first.append(owner)
        second.append(start[owner] + within)
    return np.concatenate(first), np.concatenate(second)


def _normalised_patches(grey: NDArray[np.uint8], points: Points) -> NDArray[np.float32]:
    half = PATCH // 2
    windows = np.lib.stride_tricks.sliding_window_view(grey, (PATCH, PATCH))
    patches = windows[points[:, 0] - half, points[:, 1] - half]
    flat = patches.reshape(len(points), PATCH * PATCH).astype(np.float32)
    flat -= flat.mean(axis=1, keepdims=True)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-6)
    return flat


def _predict(matches: Matches, camera: StereoCamera) -> NDArray[np.float32]:
    """Interpolate disparity on a Delaunay mesh of the matches; NaN outside it."""
    predicted = np.full(camera.shape, np.nan, np.float32)
    if len(matches) < 3:
        return predicted
    mesh = cv2.Subdiv2D((0, 0, camera.width, camera.height))
    mesh.insert(matches[:, :2].astype(np.float32).tolist())
    corners = np.asarray(mesh.getTriangleList(), np.float64).reshape(-1, 3, 2)
    size = np.array([camera.width, camera.height])
    corners = corners[((corners >= 0) & (corners < size)).all(axis=(1, 2))]
    by_place = np.zeros(camera.shape)
    columns, rows = matches[:, :2].astype(np.intp).T
    by_place[rows, columns] = matches[:, 0] - matches[:, 2]
    at = corners.astype(np.intp)
    values = by_place[at[..., 1], at[..., 0]]
    planes = np.linalg.solve(
        np.dstack((corners, np.ones(corners.shape[:2]))), values[..., np.newaxis]
    )[..., 0]
    triangle = np.zeros(camera.shape, np.int32)
    for number, polygon in enumerate(at.astype(np.int32), start=1):
        cv2.fillConvexPoly(triangle, polygon, number)
    covered = np.nonzero(triangle)
    plane = planes[triangle[covered] - 1]
    predicted[covered] = plane[:, 0] * covered[1] + plane[:, 1] * covered[0] + plane[:, 2]
    return predicted


def _correlation(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Normalised correlation of the patches around each pixel."""
    a, b = left.astype(np.float32), right.astype(np.float32)

    def mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(cv2.boxFilter(values, -1, (PATCH, PATCH)), np.float32)

    mean_a, mean_b = mean(a), mean(b)
    covariance = mean(a * b) - mean_a * mean_b
    variance = (mean(a * a) - mean_a**2) * (mean(b * b) - mean_b**2)
    return np.asarray(covariance / np.sqrt(np.maximum(variance, 1.0)), np.float32)
