"""The study's listing as printed, with only the fixes it needs to run."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import grey_pair
from rover_obstacle_detection.evaluation.methods.method import Mask

# The listing's thresholds under its own names: seeds, roughness (m), step (m), grey level.
T1 = 10
T2 = 0.0005
T3 = 0.005
T4 = 50
WINDOW_SIZE = 5
MIN_REGION_SIZE = 50


class Listing:
    """The listing of the study's section 4.2, errors included.

    Three fixes keep it from raising: Q is passed to ``reprojectImageTo3D``, the ``isfinite`` test
    reduces the last axis of a window, and the regressor is a column. Focal length and baseline
    are the camera's instead of fixed. Each region and window is processed in its own part of the
    image instead of in the whole image; the result is bit-identical.
    """

    def __call__(self, camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> Mask:
        """Run the listing on one pair; see `Method`."""
        grey, grey_right = grey_pair(left, right, camera)
        points = _points(_disparity(grey, grey_right), camera)
        regions, boxes = _regions(grey)
        depth_m = points[..., 2]
        valid = (depth_m > 0) & (depth_m < 10) & (regions > 0)
        seed_count = np.bincount(regions[valid], minlength=int(regions.max()) + 1)
        obstacle = np.zeros(regions.shape, bool)
        for number in np.unique(regions[regions > 0]):
            left_x, top_y, width, height = boxes[number]
            box = np.s_[top_y : top_y + height, left_x : left_x + width]
            few = int(seed_count[number]) < T1
            _judge_region(regions[box] == number, grey[box], points[box], few, obstacle[box])
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))
        mask = obstacle.astype(np.uint8) * 255
        closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel, iterations=2)
        return np.asarray(cv2.morphologyEx(closed, cv2.MORPH_OPEN, kernel, iterations=2), np.uint8)


def _disparity(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
    stereo = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=16 * 3,
        blockSize=5,
        P1=8 * 3 * 5 * 5,
        P2=32 * 3 * 5 * 5,
        disp12MaxDiff=1,
        uniquenessRatio=8,
        speckleWindowSize=50,
        speckleRange=2,
        preFilterCap=63,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    disparity = stereo.compute(left, right).astype(np.float32) / 16.0
    disparity[disparity <= 0] = 0
    return np.asarray(cv2.medianBlur(disparity, 5), np.float32)


def _points(disparity: NDArray[np.float32], camera: StereoCamera) -> NDArray[np.float32]:
    height, width = disparity.shape
    fov_rad = 2 * math.atan(height / (2 * camera.fy))
    fy = height / (2 * math.tan(fov_rad / 2))
    fx = fy * width / height
    cx, cy = width / 2, height / 2
    q = np.asarray(
        [[1, 0, 0, -cx], [0, 1, 0, -cy], [0, 0, 0, fx], [0, 0, 1 / camera.baseline_m, 0]],
        np.float32,
    )
    return np.asarray(cv2.reprojectImageTo3D(disparity, q), np.float32)


def _regions(grey: NDArray[np.uint8]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    shifted = cv2.pyrMeanShiftFiltering(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), sp=15, sr=20)
    segmented = cv2.cvtColor(shifted, cv2.COLOR_BGR2GRAY)
    _, binary = cv2.threshold(segmented, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(binary)
    kept = statistics[:, cv2.CC_STAT_AREA] >= MIN_REGION_SIZE
    kept[0] = False
    regions = np.where(kept[labels], labels, 0).astype(np.int32)
    return regions, np.asarray(statistics[:, : cv2.CC_STAT_AREA], np.int32)


def _judge_region(
    region: NDArray[np.bool_],
    grey: NDArray[np.uint8],
    points: NDArray[np.float32],
    has_few_points: bool,
    obstacle: NDArray[np.bool_],
) -> None:
    y_max, x_max = region.shape[0] - 1, region.shape[1] - 1
    judged = False
    for y_start in range(0, y_max, WINDOW_SIZE):
        for x_start in range(0, x_max, WINDOW_SIZE):
            y_end = min(y_start + WINDOW_SIZE, y_max + 1)
            x_end = min(x_start + WINDOW_SIZE, x_max + 1)
            window = np.s_[y_start:y_end, x_start:x_end]
            if np.count_nonzero(region[window]) < 3:
                continue
            window_points = points[window]
            window_points = window_points[np.isfinite(window_points).all(axis=2)]
            if len(window_points) < 3:
                continue
            judged = True
            if _is_rough(window_points):
                obstacle[window] |= region[window]
    if judged and has_few_points and np.mean(grey[region]) < T4:
        obstacle |= region


def _is_rough(window_points: NDArray[np.float32]) -> bool:
    depth_m = window_points[:, 2:3]
    step = float(np.max(depth_m) - np.min(depth_m))
    if step > T3:
        return True
    regressors = np.hstack([depth_m, np.ones_like(depth_m)])
    try:
        coefficients = np.linalg.lstsq(regressors, depth_m, rcond=None)[0]
    except np.linalg.LinAlgError:
        return False
    return bool(np.mean(np.abs(depth_m - regressors @ coefficients)) > T2)
