"""The time reference: one plain SGBM call."""

from __future__ import annotations

import time
from typing import Any

import cv2
from numpy.typing import NDArray

from rover_obstacle_detection.detection.geometry.camera import StereoCamera
from rover_obstacle_detection.detection.images.grey_pair import grey_pair


def plain_stereo_seconds(camera: StereoCamera, left: NDArray[Any], right: NDArray[Any]) -> float:
    """Time one SGBM call (3WAY, 64 disparities, block 5, P1 300, P2 1200), seconds."""
    grey_left, grey_right = grey_pair(left, right, camera)
    # SGBM needs an image wider than its disparity range.
    disparities = min(64, (camera.width - 1) // 16 * 16)
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=disparities,
        blockSize=5,
        P1=300,
        P2=1200,
        disp12MaxDiff=1,
        preFilterCap=63,
        uniquenessRatio=8,
        speckleWindowSize=50,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    started = time.perf_counter()
    matcher.compute(grey_left, grey_right)
    return time.perf_counter() - started
